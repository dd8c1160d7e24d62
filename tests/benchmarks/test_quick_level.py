"""The quick level after drifts, beside a whole calibration of the same machine: records, error, honesty.

The machine of the bundled cell is calibrated once. Then its true geometry differs from the result by what
the result's covariance allows, and each parameter drifts by up to 0.2 mm more. It is measured by the quick
level with the budget of the cell, and by a whole calibration from the drawing.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.checks.quick_level import QuickLevel
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import Robot
from hexacell.robot.virtual_robot import VirtualRobot
from tests.benchmarks.figures import NEVER, at_least, at_most
from tests.benchmarks.machines import Calibrated, bundled, calibrated, on_all_cores, whole_campaign
from tests.benchmarks.samples import sample

ROBOTS = sample(__name__, "ROBOTS")
SEED = 14
DRIFT_MM = 0.2
"""Uniform in both directions."""

ALLOWANCE = 1.5 / ROBOTS


@dataclass(frozen=True)
class Outcome:
    """``error_mm``: predicted at the worst task pose; ``true_mm``, ``expanded_mm``: of the largest error.

    ``refused``: why there is no result.
    """

    records: int
    error_mm: float
    true_mm: float
    expanded_mm: float
    refused: str = ""


def drifted(known: Calibrated, number: int) -> Geometry:
    random, rows = np.random.default_rng([SEED, number]), known.robot.mechanism.convention.free_rows
    factor = np.linalg.cholesky(known.covariance[np.ix_(rows, rows)])
    change = factor @ random.standard_normal(len(factor))
    drift = random.uniform(-DRIFT_MM, DRIFT_MM, len(known.by_every)) @ known.by_every
    return known.built(change + drift)


def outcome(known: Calibrated, robot: Robot, found: Identification, truth: Geometry) -> Outcome:
    """Of the geometry that was found, at the cell's task poses."""
    belief = robot.belief(found)
    task = Task.of(bundled().settings, robot, belief)
    error, jacobian = task.error(belief), task.jacobian(belief)
    budget = task.budget(found, belief, ())
    assert error is not None
    assert jacobian is not None
    assert budget is not None
    off = found.free - robot.mechanism.convention.free_parameters(truth)
    true_mm = float(np.linalg.norm((jacobian @ off)[:, :3], axis=-1).max())
    return Outcome(found.records, error.worst(belief.covariance), true_mm, budget.expanded_mm)


def by_quick_level(number: int) -> Outcome:
    known, budget = calibrated(), bundled().settings.quick.budget_records
    truth = drifted(known, number)
    quick = QuickLevel(known.check(budget), budget)
    plan = replace(quick.plan, with_forecast=False)
    campaign = VirtualCampaign(plan, VirtualRobot(known.robot, truth, np.random.default_rng([2, number])))
    campaign.carry_out()
    robot = quick.robot_after(campaign.measurements)
    try:
        found = identify(robot.problem(campaign.measurements))
    except IdentifiabilityError as error:
        return Outcome(len(campaign.measurements), np.inf, np.inf, np.inf, refused=str(error))
    return outcome(known, robot, found, truth)


def by_calibration(number: int) -> Outcome:
    known = calibrated()
    truth = drifted(known, number)
    measured = whole_campaign(bundled(), known.robot, truth, number).measurements
    return outcome(known, known.robot, identify(known.robot.problem(measured)), truth)


def middle(found: list[Outcome], name: str) -> float:
    return float(np.median([getattr(one, name) for one in found]))


def test_few_records_leave_at_most_twice_the_error_of_a_calibration(figure) -> None:
    calibrated()  # once, before the processes are made
    quick, whole = (on_all_cores(one, range(ROBOTS)) for one in (by_quick_level, by_calibration))
    of = f"of {ROBOTS} machines drifted by up to {DRIFT_MM} mm a parameter"
    figure(f"records of the quick level, median {of}", middle(quick, "records"), "", at_most(24))
    figure("  of a calibration", middle(whole, "records"))
    for name, found in (("quick", quick), ("whole", whole)):
        figure(f"  {name}: predicted error at the worst task pose", middle(found, "error_mm"), "mm")
    ratios = [one.error_mm / other.error_mm for one, other in zip(quick, whole, strict=True)]
    figure("  the first over the second: median", np.median(ratios), "", at_most(2.0))
    figure("  largest", max(ratios))
    share = np.mean([one.true_mm <= one.expanded_mm for one in quick])
    figure("U covers the true error", share, "", at_least(0.93 - ALLOWANCE))
    figure("  true error, median", middle(quick, "true_mm"), "mm")
    figure("  U, median", middle(quick, "expanded_mm"), "mm")
    refused = [one.refused for one in quick if one.refused]
    figure("  machines whose records were refused", len(refused), "; ".join(refused), NEVER)
