"""The probability of each verdict on a healthy machine: one that is as stated, calibrated as planned.

The verification will state the error of the written geometry by an estimate that has the held-out records
as well. If the model is right, that differs from the identification by d of covariance C - C' (before and
after the held-out records), and by what the systematic effects do to the one and not to the other. With
zeros alone, that are written as G of the estimate, what is held is seen to err by

    d - H (x - h),    covariance  (C - C') + H (C0 - C) H^T,    H = 1 - G,

x the identification, h what is held and C0 the covariance of its tolerances. Machines are drawn: each has
the largest error J d over the task poses and its U by draws, as in a run (``docs/verdict.md``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.held_out_sets import held_out_sets, held_out_turns
from hexacell.campaign.planner import Plan
from hexacell.cell.measuring import ErrorLimits
from hexacell.errors import HexacellError, LimitError
from hexacell.identification.diagnostics.model_tests import update
from hexacell.identification.identified_zeros import IdentifiedZeros
from hexacell.identification.solver.chi_square import SMALLEST_PROBABILITY
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot.model import Robot
from hexacell.robot.virtual_robot import exact_records
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.effects import Occurrence
from hexacell.uncertainty.statement import COVERAGE, LargestError, covariance_factor
from hexacell.verdict.decision import Verdict, decide_both

MACHINES = 500
DRAWS = 1000
"""Number of draws for each U, good to 3 %: fewer than a run has for its single statement."""
SEED = 20_100_102
TESTS = 3
"""Number of tests of the model in every run: residuals, held-out records, and points by the others."""
WANTED = 0.95
"""Probability to pass below which a limit is one that good machines fail."""
NOISE = "noise of the readings"


@dataclass(frozen=True, slots=True)
class VerdictForecast:
    """The verdicts of a run on healthy machines.

    Attributes:
        probabilities: probability of each verdict under the ``limits``.
        passing: limits that 95 % of such machines would pass, each by itself.
        largest_part: the line of the budget that contributes most to U at the worst task pose.
        largest_part_mm: its standard uncertainty there, and ``standard_mm`` that of all together.
    """

    probabilities: Mapping[Verdict, float]
    limits: ErrorLimits
    passing: ErrorLimits
    largest_part: str
    largest_part_mm: float
    standard_mm: float

    @property
    def is_wanted(self) -> bool:
        """Whether the limits are such that a good machine passes."""
        return self.probabilities[Verdict.PASS] >= WANTED

    @staticmethod
    def mean(each: "Sequence[VerdictForecast]") -> "VerdictForecast":
        """The mean over some robots; the limits and the parts are those of the worst of them."""
        worst = max(each, key=lambda one: one.passing.position_mm)
        degrees = max(one.passing.orientation_deg for one in each)
        means = {kind: float(np.mean([one.probabilities[kind] for one in each])) for kind in Verdict}
        passing = worst.passing.model_copy(update={"orientation_deg": degrees})
        return replace(worst, probabilities=means, passing=passing)


def forecast_verdicts(stated: Array, budget: UncertaintyBudget, limits: ErrorLimits) -> VerdictForecast:
    """The verdicts on machines that are drawn.

    Args:
        stated: (t, 6, k) change of the errors that will be stated, by one standard deviation of each
            independent cause.
        budget: uncertainty of all that will not be known of them.
        limits: limits of the cell.
    """
    unknown = budget.errors_of(np.zeros(budget.jacobian.shape[-1])).effects
    random = np.random.default_rng(SEED)
    machines = random.standard_normal((MACHINES, stated.shape[-1]))
    draws = random.standard_normal((DRAWS, unknown.shape[-1]))
    errors = np.tensordot(machines, stated, axes=(1, 2))
    around = np.tensordot(draws, unknown, axes=(1, 2))
    positions = _statements(errors[..., :3], around[..., :3])
    orientations = _statements(np.degrees(errors[..., 3:]), np.degrees(around[..., 3:]))
    verdicts = [decide_both(*both, limits) for both in zip(positions, orientations, strict=True)]
    parts = [(line.combined_mm, line.effect.name) for line in budget.lines if not line.effect.is_estimated]
    part, name = max([(budget.noise_mm, NOISE), *parts])
    factor = limits.guard_band_factor
    passing = {
        "position_mm": _passing(positions, factor),
        "orientation_deg": _passing(orientations, factor),
    }
    # The tests of the model fail independently.
    tested = (1.0 - SMALLEST_PROBABILITY) ** TESTS
    shares = {verdict: tested * verdicts.count(verdict) / len(verdicts) for verdict in Verdict}
    shares[Verdict.NOT_EVALUATED] += 1.0 - tested
    return VerdictForecast(
        shares, limits, limits.model_copy(update=passing), name, part, budget.standard_mm
    )


def stated_errors(
    found: Identification,
    updated: Identification,
    first: UncertaintyBudget,
    second: UncertaintyBudget,
    zeros: IdentifiedZeros | None = None,
) -> Array:
    """How the error that will be stated changes (t, 6, k) by one standard deviation of each cause.

    ``updated`` is the identification by the held-out records as well; ``first`` and ``second`` are the
    budgets of the two. ``zeros`` are what is written of ``found``, where that is not all of it.
    """
    held = np.zeros_like(found.free_covariance)
    if zeros is not None:
        held = np.eye(len(held)) - zeros.projector
    of_held = zeros.kept.tolerances - found.free_covariance if zeros else held
    columns = [
        covariance_factor(found.free_covariance - updated.free_covariance),
        held @ covariance_factor(of_held),
    ]
    before = {line.effect.name: line for line in first.lines}
    for line in second.lines:
        effect, earlier = line.effect, before[line.effect.name]
        if effect.is_estimated or not effect.size:
            continue
        if effect.occurrence is Occurrence.EVERY_STOP:
            # Other stops: what they do to the two estimates differs as their covariances do.
            old, new = (one.parameter_columns for one in (earlier, line))
            columns.append(effect.size * covariance_factor(old @ old.T - new @ new.T))
            columns.append(effect.size * held @ old)
        elif effect.occurrence.is_in_records:
            old, new = earlier.parameter_columns, line.parameter_columns
            columns.append(effect.size * (old - new - held @ old))
    return np.asarray(second.jacobian @ np.concatenate(columns, axis=1))


def _statements(errors: Array, around: Array) -> list[LargestError]:
    """The largest errors of machines (n, t, 3), each with its U by draws (d, t, 3) around it."""
    found = []
    for one in errors:
        value = float(np.linalg.norm(one, axis=-1).max())
        largest = np.linalg.norm(one + around, axis=-1).max(axis=-1)
        found.append(LargestError(value, float(np.quantile(np.abs(largest - value), COVERAGE))))
    return found


def _passing(statements: Sequence[LargestError], guard_band_factor: float) -> float:
    return float(np.quantile([one.value + guard_band_factor * one.expanded for one in statements], WANTED))


def predicted_verdicts(
    plan: Plan, found: Identification, budget: UncertaintyBudget | None, sets: Sequence[PoseBatch]
) -> VerdictForecast | None:
    """The verdicts of a run on healthy machines with this geometry; None where none can be predicted.

    ``budget`` is that of the identification, ``sets`` are the held-out poses afterwards. With zeros alone
    what is held is as wrong as its tolerances allow.
    """
    try:
        updated = with_held_out_records(plan, found, sets)
    except HexacellError:
        return None
    after = plan.task.budget(updated, plan.robot.belief(updated), plan.robot.effects)
    if budget is None or after is None or len(after.jacobian) != len(budget.jacobian):
        return None
    stated = stated_errors(found, updated, budget, after, plan.robot.identified_zeros(found))
    return forecast_verdicts(stated, after, plan.settings.acceptance.of_errors)


def predicted_held_out_sets(plan: Plan, found: Identification) -> list[PoseBatch]:
    """The wide poses at the held-out points after the write-back, if the identification is right.

    Points at which the robot takes too few are left out; all, if it can be given no such geometry.
    """
    try:
        robot = _with_written(plan, found)
    except HexacellError:
        return []
    turns = held_out_turns(robot, plan.settings, plan.effort.forecast_held_out_candidates)
    sets = held_out_sets(robot, plan.settings, found, turns, plan.settings.verification.orientations)
    return [poses for poses in sets if isinstance(poses, PoseBatch)]


def with_held_out_records(plan: Plan, found: Identification, sets: Sequence[PoseBatch]) -> Identification:
    """The identification updated by the records that the held-out ``sets`` will give if it is right.

    The small tilts that are measured before as well add little.

    Raises:
        LimitError: there are none.
    """
    robot = _with_written(plan, found)
    records: list[Record] = []
    for point, poses in enumerate(sets, 1 + max(plan.points)):
        records += exact_records(robot, point, poses)
    if not records:
        raise LimitError("the robot takes too few poses at each of the held-out points")
    return update(found, robot.problem(MeasurementSet(tuple(records))))


def _with_written(plan: Plan, found: Identification) -> Robot:
    """The robot whose controller has what will be written of an identification."""
    written = (plan.robot.identified_zeros(found) or found).geometry
    return plan.robot.with_controller(plan.robot.for_controller(written))
