"""The chain of estimates: each one starts from the one before it, and is doubted if it is implausible.

One more record changes the estimate little, so that the search starts at the former estimate. If its cost
is too large for the noise, some records may be false, or the solver is in a wrong minimum. Both are
searched for: false records first, as soon as the others would determine the parameters without them, then
other minima, from the drawing and from random geometries within the tolerances.

A search that explains nothing is remembered. Another record would not change its outcome, so that the next
one is made when there is more to explain or more to explain it by: twice the cost, or half as many records
again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.data_faults.hypotheses import record_ids, record_mask
from hexacell.identification.data_faults.online_rejection import without_gross_errors
from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.data_requirements import is_determined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import COARSE, INCREMENTAL
from hexacell.identification.solver.multistart import restarts
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import RecordId

IMPLAUSIBLE_COST = 3.0
"""Per residual. A larger cost may be that of a local minimum, or of false records."""

FEW_RESIDUALS = 30.0
"""Added to their number, since few of them may be large by chance."""

COST_FACTOR = 2.0
RECORDS_FACTOR = 1.5
"""By how much cost or records have grown since a search in vain when the next one is made."""

SAME_MINIMUM = 6
"""Starts of half of a search that end in one minimum: another one would be found by some of them."""

SAME_COST = 0.01

TRIAL = replace(COARSE, iterations=20, searches=12)
"""As many iterations as true records need; where others need more, they are in vain."""


@dataclass(frozen=True, slots=True)
class SearchInVain:
    """A search that found no plausible estimate: the cost that was to be explained, of how many records."""

    cost: float
    records: int

    def is_outdated(self, present_cost: float, records: int) -> bool:
        """Whether there is so much more to explain, or to explain it by, that another one may help."""
        return present_cost >= COST_FACTOR * self.cost or records >= RECORDS_FACTOR * self.records


@dataclass(frozen=True, slots=True, eq=False)
class ChainedEstimate:
    """An estimate of the chain.

    Attributes:
        false_records: those that were found false and are left out.
        in_vain: the last search, if it found no plausible estimate and this one is still implausible.
    """

    identification: Identification
    false_records: frozenset[RecordId] = frozenset()
    in_vain: SearchInVain | None = None


def update_estimate(
    problem: Problem, before: ChainedEstimate | None, tries_others: bool = True
) -> ChainedEstimate:
    """The estimate from that of all records but the last; with ``tries_others``, doubted if implausible."""
    if before is None:
        return ChainedEstimate(estimate_online(problem))
    kept = problem.subset(~record_mask(problem, before.false_records))
    found = _continued(kept, before.identification)
    if not tries_others or _is_plausible(kept, found):
        return ChainedEstimate(found, before.false_records)
    if before.in_vain is not None and not before.in_vain.is_outdated(cost(found), problem.records):
        return replace(before, identification=found)
    return _search(problem, _continued(problem, found) if before.false_records else found)


def cost(found: Identification) -> float:
    """What the estimate minimized: squared residuals and distance from the drawing, both by sigma."""
    return found.chi2 + found.problem.prior.squared_distance(found.free)


def _search(problem: Problem, found: Identification) -> ChainedEstimate:
    """A plausible estimate: without false records, or from another start; else the best one."""
    if clean := _without_false_records(found):
        return clean
    best = _best(problem, found)
    if _is_plausible(problem, best):
        return ChainedEstimate(best)
    # The best one may be of fewer records, and the cost of all of them is what there was to explain.
    in_vain = SearchInVain(max(cost(found), cost(best)), problem.records)
    return _without_false_records(best) or ChainedEstimate(best, in_vain=in_vain)


def _without_false_records(found: Identification) -> ChainedEstimate | None:
    """The plausible estimate from most of the records, if there is one."""
    for fewer in without_gross_errors(found):
        if _is_plausible(fewer.problem, fewer):
            false = frozenset(record_ids(found.problem)) - frozenset(record_ids(fewer.problem))
            return ChainedEstimate(fewer, false)
    return None


def _best(problem: Problem, found: Identification) -> Identification:
    """The estimate with most records and lowest cost from any start, or the first plausible one.

    The same minimum from enough starts is the only one.
    """
    others, again = _from_other_starts(problem), 0
    while again < SAME_MINIMUM and not _is_plausible(problem, found) and (other := next(others, None)):
        is_better = (other.records, -cost(other)) > (found.records, -cost(found))
        if _is_same_minimum(found, other):
            again += 1
        elif is_better:
            again = 0
        found = other if is_better else found
    return found if found.converged else _continued(problem, found)


def _is_same_minimum(found: Identification, other: Identification) -> bool:
    is_near = abs(cost(other) - cost(found)) <= SAME_COST * cost(found)
    return other.records == found.records and is_near


def _is_plausible(problem: Problem, found: Identification) -> bool:
    is_small = cost(found) <= IMPLAUSIBLE_COST * found.problem.coordinates + FEW_RESIDUALS
    return found.converged and found.records == problem.records and is_small


def _from_other_starts(problem: Problem) -> Iterator[Identification]:
    """Estimates from the drawing, and from random geometries within the tolerances.

    With few records, one of them may be beyond a singularity for all robots near the drawing.
    """
    yield estimate_online(problem)
    for restarted in restarts(problem):
        yield estimate_online(restarted, TRIAL)


def _continued(problem: Problem, before: Identification) -> Identification:
    """The estimate from one of fewer or other records; from the drawing where a pose is not found."""
    poses = _start_poses(problem, before)
    if poses is None:
        return estimate_online(problem)
    # While the records leave much open, undamped steps may diverge.
    options = INCREMENTAL if is_determined(problem) else COARSE
    return estimate_online(problem.starting_at(before.free, poses), options)


def _start_poses(problem: Problem, before: Identification) -> PoseBatch | None:
    """Poses that close the former estimate, to start the search; none if one is not found."""
    old = problem.rows_of(before.problem.labels)
    is_new = np.ones(problem.records, dtype=bool)
    is_new[old] = False
    new = np.flatnonzero(is_new)
    solved = problem.commands[new].solve_poses(before.geometry, problem.joints[new])
    if not solved.found[problem.has_start_pose[new]].all():
        return None
    return problem.commands.poses.with_rows(new, solved.poses).with_rows(old, before.poses)
