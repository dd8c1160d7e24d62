"""The quick level after drifts, beside a whole calibration of the same machine: records, error, honesty.

The machine of the bundled cell is calibrated once. Then its true geometry differs from the result by what
the result's covariance allows, and each parameter drifts by up to 0.2 mm more. It is measured by the quick
level with the budget of the cell, and by a whole calibration from the drawing. ``ROBOTS`` in the
environment says how many machines drift; the targets are for 100. All cores are used.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from multiprocessing import get_context

import numpy as np
import pytest

from hexacell.campaign.planner import Plan
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.checks.check import Check, identified_before
from hexacell.checks.quick_level import QuickLevel
from hexacell.design.search_effort import SearchEffort
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import free_parameter_derivatives
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.verdict.decision import ErrorLimits

Say = Callable[[str, str, str], None]

pytestmark = pytest.mark.benchmark

ROBOTS = int(os.environ.get("ROBOTS", "12"))
SEED = 14
LARGE_MM, SMALL_MM = 0.2, 0.01
"""Drifts, uniform in both directions."""

STATED_MM = 0.02
"""What the cell file states a parameter may have drifted, one sigma."""

EFFORT = SearchEffort(candidates=128)
PARITY = 70
ALLOWANCE = 1.5 / ROBOTS


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A machine whose controller has an identified geometry, with its covariance (P, P), mm^2."""

    robot: Robot
    covariance: Array

    def quick(self, budget: int, drift_mm: float) -> QuickLevel:
        settings = bundled().settings
        before = identified_before(self.robot, self.covariance, drift_mm)
        limits = ErrorLimits.of(settings.acceptance)
        return QuickLevel(Check(settings, self.robot, before, limits, budget, effort=EFFORT), budget)


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


@lru_cache
def bundled() -> Cell:
    """Its settings cannot be sent to another process."""
    return load_cell(bundled_config("simulated-hexaglide"))


@lru_cache
def calibrated() -> Calibrated:
    cell = bundled()
    robot = robot_of(cell)
    assert cell.settings.simulation is not None
    actual = Geometry.of(robot.mechanism.parameters, cell.settings.simulation.geometry.model_dump())
    truth = robot.mechanism.normalize_frames(actual)[0]
    campaign = whole_campaign(cell, robot, truth, 1)
    found = identify(robot.problem(campaign.measurements))
    frames = robot.mechanism.normalize_frames(found.geometry)[1]
    return Calibrated(replace(robot, controller=found.geometry, frames=frames), found.covariance)


def whole_campaign(cell: Cell, robot: Robot, truth: Geometry, seed: int) -> VirtualCampaign:
    plan = Plan(cell.settings, robot, effort=EFFORT, with_forecast=False)
    campaign = VirtualCampaign(plan, VirtualRobot(robot, truth, np.random.default_rng(seed)))
    campaign.carry_out()
    return campaign


def drifted(known: Calibrated, drift_mm: float, number: int) -> Geometry:
    robot, random = known.robot, np.random.default_rng([SEED, number])
    convention = robot.mechanism.convention
    rows = robot.mechanism.convention.free_rows
    factor = np.linalg.cholesky(known.covariance[np.ix_(rows, rows)])
    by_every = free_parameter_derivatives(robot.mechanism, robot.commanding)
    change = factor @ random.standard_normal(len(factor))
    change += random.uniform(-drift_mm, drift_mm, len(by_every)) @ by_every
    return convention.geometry(convention.free_parameters(robot.commanding) + change)


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
    truth, quick = drifted(known, drift_mm, number), known.quick(budget, stated_mm)
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


@dataclass(frozen=True)
class Compared:
    quick: tuple[Outcome, ...]
    whole: tuple[Outcome, ...]
    generous: tuple[Outcome, ...]
    little: tuple[Outcome, ...]
    ratios: tuple[float, ...]


@pytest.fixture(scope="module")
def compared() -> Compared:
    calibrated()  # once, before the processes are made
    budget, numbers = bundled().settings.quick.budget_records, range(ROBOTS)
    with ProcessPoolExecutor(mp_context=get_context("fork")) as pool:
        quick = tuple(pool.map(by_quick_level, [(budget, STATED_MM, LARGE_MM, one) for one in numbers]))
        whole = tuple(pool.map(by_calibration, [(LARGE_MM, one) for one in numbers]))
        generous = tuple(pool.map(by_quick_level, [(PARITY, STATED_MM, LARGE_MM, one) for one in numbers]))
        little = tuple(pool.map(by_quick_level, [(budget, SMALL_MM, SMALL_MM, one) for one in numbers]))
    ratios = tuple(one.error_mm / other.error_mm for one, other in zip(quick, whole, strict=True))
    return Compared(quick, whole, generous, little, ratios)


def middle(found: tuple[Outcome, ...], name: str) -> float:
    return float(np.median([getattr(one, name) for one in found]))


def covered(found: tuple[Outcome, ...]) -> float:
    return float(np.mean([one.true_mm <= one.expanded_mm for one in found]))


def test_few_records_leave_at_most_twice_the_error_of_a_calibration(compared, say) -> None:
    ratio = float(np.median(compared.ratios))
    records, whole = middle(compared.quick, "records"), middle(compared.whole, "records")
    say(f"machines drifted by up to {LARGE_MM} mm a parameter", f"{ROBOTS}", "100")
    say("records of the quick level, of a calibration, median", f"{records:.0f}, {whole:.0f}", "24")
    errors = f"{middle(compared.quick, 'error_mm'):.3f}, {middle(compared.whole, 'error_mm'):.3f} mm"
    say("  predicted error at the worst task pose (one sigma)", errors, "")
    shown = f"{ratio:.2f}, {max(compared.ratios):.2f}"
    say("  the first over the second: median, largest", shown, "at most 2 at the median")
    assert records <= 24
    assert ratio <= 2.0


def test_the_error_is_stated_honestly(compared, say) -> None:
    for name, found in (("quick level", compared.quick), ("small drifts", compared.little)):
        share, true_mm = covered(found), middle(found, "true_mm")
        say(f"U covers the true error, {name}", f"{100 * share:.0f} %", "at least 93 %")
        say("  true error and U, median", f"{true_mm:.3f}, {middle(found, 'expanded_mm'):.3f} mm", "")
        assert share >= 0.93 - ALLOWANCE


def test_no_machine_is_refused(compared, say) -> None:
    refused = [one.refused for one in (*compared.quick, *compared.little) if one.refused]
    say("machines whose records were refused", f"{len(refused)}", "none")
    assert not refused


def test_a_larger_budget_reaches_the_calibration_and_no_more_is_measured(compared, say) -> None:
    """The rows of the calibration and of the larger budget are of the same machines."""
    records = middle(compared.generous, "records")
    ratio = float(
        np.median([a.error_mm / b.error_mm for a, b in zip(compared.generous, compared.whole, strict=True)])
    )
    say(f"with {PARITY} records allowed: records, error ratio", f"{records:.0f}, {ratio:.2f}", "about 1")
    told = [one.records + one.told for one in compared.quick if one.told is not None]
    say("  what the first runs had said would be needed, median", f"{np.median(told):.0f}", "")
    assert ratio <= 1.15
    assert records <= PARITY


def test_small_drifts_need_few_records(compared, say) -> None:
    ratio = float(
        np.median([a.error_mm / b.error_mm for a, b in zip(compared.little, compared.whole, strict=True)])
    )
    records = middle(compared.little, "records")
    say(f"drifts of {SMALL_MM} mm, stated: records, error ratio", f"{records:.0f}, {ratio:.2f}", "24, 1")
    assert ratio <= 1.1
    assert records <= 24
