"""The estimate while measuring: a chain, each one starting from the one before it.

The estimate of n records is defined as the n-th of this chain, which begins at the drawing. Keeping the
last one saves its computation and changes nothing: without it the chain is computed again.

One more record changes the estimate little. If its residuals are too large for the noise, the robot may
have terms beside the geometry, which are chosen as in the end. If its cost is far too large, some records
false, or the solver is in a wrong minimum. Both are searched for: false records first, as soon as the
others would determine the parameters without them, then other minima, from the drawing and from random
geometries within the tolerances. A search that explains nothing is remembered: the next one is made when
there is more to explain or more to explain it by, twice the cost, or half as many records again.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.pilots import are_counted
from hexacell.design.predicted_records import GaugeZero, gauge_zero_at
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.choice_of_terms import choose_terms
from hexacell.identification.estimator import estimate_online, with_terms_of, without_gross_errors
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareVerdict
from hexacell.identification.solver.fit import COARSE, INCREMENTAL
from hexacell.identification.solver.multistart import restarts
from hexacell.identification.solver.result import Identification
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import MeasurementSet, Record, RecordId
from hexacell.robot.model import Robot

IMPLAUSIBLE_COST = 3.0
"""Cost per residual above which an estimate may be in a local minimum, or of false records."""

FEW_RESIDUALS = 30.0
"""Added to the number of residuals, since a few of them may be large by chance."""

COST_FACTOR = 2.0
RECORDS_FACTOR = 1.5
"""By how much cost or records have grown since a search in vain when the next one is made."""

SAME_MINIMUM = 6
"""Starts that end in one minimum before it is taken for the only one: half of a whole search."""

SAME_COST = 0.01
"""Relative difference of cost within which two minima are the same."""

TRIAL = replace(COARSE, iterations=20, searches=12)
"""Solver options from another start: as many iterations as true records need; more would be in vain."""


@dataclass(frozen=True, slots=True, eq=False)
class OnlineEstimate:
    """The estimate of the robot from the records so far.

    Attributes:
        identification: the fit; None before the first record.
        false_records: those that the others prove false; they are not in the identification.
    """

    belief: RobotBelief
    identification: Identification | None
    false_records: frozenset[RecordId] = frozenset()

    def of_records_alone(self) -> Identification | None:
        """The identification without pilot records, from this one on; None before the first record."""
        found = self.identification
        if found is None or (counted := are_counted(found.problem)).all():
            return found
        problem, poses = found.problem.subset(counted), found.poses[np.flatnonzero(counted)]
        return estimate_online(problem.starting_at(found.free, poses))

    def gauge_zero(self, point: int) -> GaugeZero:
        """Where a point's gauges were zeroed. Raises ``LimitError``: there are no records of the point."""
        found = self.identification
        if found is None or point not in found.problem.labels[:, 0]:
            raise LimitError("the records of this point do not determine the ball's position")
        return gauge_zero_at(self.belief, found, point)


RecordEstimator = Callable[[MeasurementSet], OnlineEstimate]
"""Estimates the robot from any records; raises ``IdentifiabilityError`` if they are of another robot."""


class OnlineEstimator:
    """Estimates from any records, quickly where they continue the last ones asked for.

    With ``tries_other_starts`` false an implausible estimate is kept: the robot is near its prior, or the
    prior is wrong.
    """

    def __init__(self, robot: Robot, *, tries_other_starts: bool = True) -> None:
        self._robot = robot
        self._tries_other_starts = tries_other_starts
        self._records: tuple[Record, ...] = ()
        self._last: ChainedEstimate | None = None
        self._problem: Problem | None = None

    def estimate(self, measurements: MeasurementSet) -> OnlineEstimate:
        """The estimate from some records, in their order.

        Raises:
            IdentifiabilityError: they do not belong to this robot.
        """
        records = measurements.records
        if records[: len(self._records)] != self._records:
            self._records, self._last, self._problem = (), None, None
        for count in range(len(self._records) + 1, len(records) + 1):
            self._problem = self._robot.problem(MeasurementSet(records[:count]), self._problem)
            self._last = update_estimate(self._problem, self._last, self._tries_other_starts)
            self._records = records[:count]
        if self._last is None:
            return OnlineEstimate(self._robot.belief(), None)
        found = self._last.identification
        return OnlineEstimate(self._robot.belief(found), found, self._last.false_records)


@dataclass(frozen=True, slots=True, eq=False)
class ChainedEstimate:
    """An estimate of the chain.

    Attributes:
        false_records: those that were found false and are left out.
        in_vain: the cost that the last search was to explain, and of how many records, if it found no
            plausible estimate and this one is still implausible.
        terms: those beside the geometry that the robot is taken to have.
        terms_tried: of how many records they were chosen last.
    """

    identification: Identification
    false_records: frozenset[RecordId] = frozenset()
    in_vain: tuple[float, int] | None = None
    terms: tuple[ModelTerm, ...] = ()
    terms_tried: int = 0

    def may_be_searched(self, present_cost: float, records: int) -> bool:
        """Whether there is so much more to explain, or to explain it by, that another search may help."""
        if self.in_vain is None:
            return True
        return present_cost >= COST_FACTOR * self.in_vain[0] or records >= RECORDS_FACTOR * self.in_vain[1]


def update_estimate(
    problem: Problem, before: ChainedEstimate | None, tries_others: bool = True
) -> ChainedEstimate:
    """The estimate from that of all records but the last; with ``tries_others``, doubted if implausible."""
    if before is None:
        return ChainedEstimate(estimate_online(problem))
    if before.terms:
        problem = with_terms_of(problem, before.identification)
    kept = problem.subset(~problem.mask_of(before.false_records))
    found = _continued(kept, before.identification)
    # Residuals that the noise does not explain are a reason to choose terms, or others.
    is_due = bool(found.problem.offered) and found.records >= RECORDS_FACTOR * before.terms_tried
    if is_due and found.noise_test.agreement is ChiSquareVerdict.TOO_LARGE:
        # While records do not tell which of them the robot has, it may have all: less is known of it than
        # its records seem to say, and poses keep more of the gauges' travel.
        chosen = choose_terms(found).taken or found.problem.offered
        nearly = estimate_online(problem.started_at(found.free).with_terms(chosen))
        better = estimate_online(with_terms_of(problem, nearly))
        return ChainedEstimate(better, terms=chosen, terms_tried=problem.records)
    following = _following(problem, kept, found, before, tries_others=tries_others)
    return replace(following, terms=before.terms, terms_tried=before.terms_tried)


def _following(
    problem: Problem, kept: Problem, found: Identification, before: ChainedEstimate, *, tries_others: bool
) -> ChainedEstimate:
    """The estimate found from the ``kept`` records, or another one if that is implausible."""
    if not tries_others or _is_plausible(kept, found):
        return ChainedEstimate(found, before.false_records)
    if not before.may_be_searched(cost(found), problem.records):
        return replace(before, identification=found)
    return _search(problem, _continued(problem, found) if before.false_records else found)


def cost(found: Identification) -> float:
    """What the estimate minimized: squared residuals and distance from the drawing, both by sigma."""
    return found.chi2 + found.problem.prior.squared_distance(found.free)


def _is_plausible(problem: Problem, found: Identification) -> bool:
    """Whether an estimate is of all records of the problem, with residuals as the noise explains them."""
    is_small = cost(found) <= IMPLAUSIBLE_COST * found.problem.coordinates + FEW_RESIDUALS
    return found.termination.converged and found.records == problem.records and is_small


def _search(problem: Problem, found: Identification) -> ChainedEstimate:
    """Another estimate in the place of an implausible one, the most trusting explanation first.

    That some records are false; that the solver is in a wrong minimum; both. If nothing explains the
    records, the best estimate with a note of what was searched in vain.
    """
    if clean := _without_false_records(found):
        return clean
    best = _from_other_starts(problem, found)
    if _is_plausible(problem, best):
        return ChainedEstimate(best)
    # The best one may be of fewer records, and the cost of all of them is what there was to explain.
    unexplained = max(cost(found), cost(best))
    return _without_false_records(best) or ChainedEstimate(best, in_vain=(unexplained, problem.records))


def _without_false_records(found: Identification) -> ChainedEstimate | None:
    """The plausible estimate from most of the records, if there is one."""
    for fewer in without_gross_errors(found):
        if _is_plausible(fewer.problem, fewer):
            false = frozenset(found.problem.record_ids) - frozenset(fewer.problem.record_ids)
            return ChainedEstimate(fewer, false)
    return None


def _from_other_starts(problem: Problem, found: Identification) -> Identification:
    """The estimate with most records and lowest cost of those from any start.

    The search ends at a plausible one, and when enough starts have led to the same minimum: then that is
    the only one.
    """
    best, same, others = found, 0, _estimates_from_other_starts(problem)
    while same < SAME_MINIMUM and not _is_plausible(problem, best):
        if (other := next(others, None)) is None:
            break
        is_better = (other.records, -cost(other)) > (best.records, -cost(best))
        is_near = abs(cost(other) - cost(best)) <= SAME_COST * cost(best)
        if is_near and other.records == best.records:
            same += 1
        elif is_better:
            same = 0
        best = other if is_better else best
    return best if best.termination.converged else _continued(problem, best)


def _estimates_from_other_starts(problem: Problem) -> Iterator[Identification]:
    """Estimates from the drawing, and from random geometries within the tolerances.

    With few records, one of them may be beyond a singularity for all robots near the drawing.
    """
    yield estimate_online(problem)
    yield from (estimate_online(restarted, TRIAL) for restarted in restarts(problem))


def _continued(problem: Problem, before: Identification) -> Identification:
    """The estimate from one of fewer or other records; from the drawing where a pose is not found."""
    if (poses := _start_poses(problem, before)) is None:
        return estimate_online(problem)
    # While the records leave much open, undamped steps may diverge.
    options = INCREMENTAL if problem.is_determined else COARSE
    return estimate_online(problem.starting_at(before.free, poses, problem.has_start_pose), options)


def _start_poses(problem: Problem, before: Identification) -> PoseBatch | None:
    """Poses that close the previous estimate, to start the search; None if one is not found."""
    rows = problem.rows_of(before.problem.labels)
    old = rows[rows >= 0]
    new = np.setdiff1d(np.arange(problem.records), old)
    solved = problem.commands[new].solve_poses(before.geometry, problem.joints[new])
    if not solved.found[problem.has_start_pose[new]].all():
        return None
    return problem.commands.poses.with_rows(new, solved.poses).with_rows(old, before.poses[rows >= 0])
