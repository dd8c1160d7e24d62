"""The quick level after drifts, beside a whole calibration of the same machine: records, error, honesty.

The machine of the bundled cell is calibrated once. Then its true geometry differs from the result by what
the result's covariance allows, and each parameter drifts by up to 0.2 mm more. It is measured by the quick
level with the budget of the cell, and by a whole calibration from the drawing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

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
from tests.benchmarks.machines import (
    STATED_DRIFT_MM,
    Calibrated,
    bundled,
    calibrated,
    on_all_cores,
    whole_campaign,
)
from tests.benchmarks.samples import sample

ROBOTS = sample(__name__, "ROBOTS")
SEED = 14
LARGE_MM, SMALL_MM = 0.2, 0.01
"""Drifts, uniform in both directions."""

PARITY = 70
ALLOWANCE = 1.5 / ROBOTS


@dataclass(frozen=True)
class Outcome:
    """``error_mm``: predicted at the worst task pose; ``true_mm``, ``expanded_mm``: of the largest error.

    ``told``: records that are told to leave as little as the calibration; ``refused``: why there is no
    result.
    """

    records: int
    error_mm: float
    true_mm: float
    expanded_mm: float
    told: int | None = None
    refused: str = ""


def drifted(known: Calibrated, drift_mm: float, number: int) -> Geometry:
    random, rows = np.random.default_rng([SEED, number]), known.robot.mechanism.convention.free_rows
    factor = np.linalg.cholesky(known.covariance[np.ix_(rows, rows)])
    change = factor @ random.standard_normal(len(factor))
    return known.built(change + random.uniform(-drift_mm, drift_mm, len(known.by_every)) @ known.by_every)


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


def by_quick_level(job: tuple[int, float, float, int]) -> Outcome:
    known, (budget, stated_mm, drift_mm, number) = calibrated(), job
    truth = drifted(known, drift_mm, number)
    quick = QuickLevel(known.check(budget, stated_mm), budget)
    plan = replace(quick.plan, with_forecast=False)
    campaign = VirtualCampaign(plan, VirtualRobot(known.robot, truth, np.random.default_rng([2, number])))
    campaign.carry_out()
    robot = quick.robot_after(campaign.measurements)
    try:
        found = identify(robot.problem(campaign.measurements))
    except IdentifiabilityError as error:
        return Outcome(len(campaign.measurements), np.inf, np.inf, np.inf, refused=str(error))
    told = quick.accuracy(campaign.measurements)
    assert told is not None
    return replace(outcome(known, robot, found, truth), told=told.records_to_calibrated)


def by_calibration(job: tuple[float, int]) -> Outcome:
    known, (drift_mm, number) = calibrated(), job
    truth = drifted(known, drift_mm, number)
    measured = whole_campaign(bundled(), known.robot, truth, number).measurements
    return outcome(known, known.robot, identify(known.robot.problem(measured)), truth)


@pytest.fixture(scope="module")
def compared() -> dict[str, list[Outcome]]:
    calibrated()  # once, before the processes are made
    budget, numbers = bundled().settings.quick.budget_records, range(ROBOTS)

    def quick(budget: int, stated_mm: float, drift_mm: float) -> list[Outcome]:
        return on_all_cores(by_quick_level, [(budget, stated_mm, drift_mm, one) for one in numbers])

    return {
        "quick": quick(budget, STATED_DRIFT_MM, LARGE_MM),
        "whole": on_all_cores(by_calibration, [(LARGE_MM, one) for one in numbers]),
        "generous": quick(PARITY, STATED_DRIFT_MM, LARGE_MM),
        "little": quick(budget, SMALL_MM, SMALL_MM),
    }


def middle(found: list[Outcome], name: str) -> float:
    return float(np.median([getattr(one, name) for one in found]))


def ratios(compared: dict[str, list[Outcome]], which: str) -> list[float]:
    """Predicted errors over those of a calibration of the same machine."""
    pairs = zip(compared[which], compared["whole"], strict=True)
    return [one.error_mm / other.error_mm for one, other in pairs]


def test_few_records_leave_at_most_twice_the_error_of_a_calibration(compared, figure) -> None:
    of, found = (
        f"of {ROBOTS} machines drifted by up to {LARGE_MM} mm a parameter",
        ratios(compared, "quick"),
    )
    figure(
        f"records of the quick level, median {of}", middle(compared["quick"], "records"), "", at_most(24)
    )
    figure("  of a calibration", middle(compared["whole"], "records"))
    for name in ("quick", "whole"):
        figure(
            f"  {name}: predicted error at the worst task pose", middle(compared[name], "error_mm"), "mm"
        )
    figure("  the first over the second: median", np.median(found), "", at_most(2.0))
    figure("  largest", max(found))


@pytest.mark.parametrize("which", ["quick", "little"])
def test_the_error_is_stated_honestly(compared, figure, which) -> None:
    found = compared[which]
    share = np.mean([one.true_mm <= one.expanded_mm for one in found])
    figure(f"U covers the true error, {which}", share, "", at_least(0.93 - ALLOWANCE))
    figure("  true error, median", middle(found, "true_mm"), "mm")
    figure("  U, median", middle(found, "expanded_mm"), "mm")
    refused = [one.refused for one in found if one.refused]
    figure("  machines whose records were refused", len(refused), "; ".join(refused), NEVER)


def test_a_larger_budget_reaches_the_calibration_and_no_more_is_measured(compared, figure) -> None:
    """The rows of the calibration and of the larger budget are of the same machines."""
    records = middle(compared["generous"], "records")
    figure(f"with {PARITY} records allowed: records", records, "", at_most(PARITY))
    figure("  error ratio", np.median(ratios(compared, "generous")), "", at_most(1.15))
    told = [one.records + one.told for one in compared["quick"] if one.told is not None]
    figure("  what the first runs had said would be needed, median", np.median(told) if told else None)


def test_small_drifts_need_few_records(compared, figure) -> None:
    figure(
        f"drifts of {SMALL_MM} mm, stated: records", middle(compared["little"], "records"), "", at_most(24)
    )
    figure("  error ratio", np.median(ratios(compared, "little")), "", at_most(1.1))
