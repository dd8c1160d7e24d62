"""Every mechanism that comes with the package: robots drawn within the tolerances of its bundled cell.

Each is calibrated as a run does it, with the limits and the noise of the cell, and its result is verified.
``ROBOTS`` in the environment says how many of each, ``MECHANISMS`` which bundled cells.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from hexacell.campaign.planner import Plan
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.config.interface import ControllerGeometry
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.results.written_geometry import as_written
from hexacell.robot.model import Robot, make_robot, robot_of
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.verdict.decision import Verdict
from tests.benchmarks.tolerance_bound import largest_chances
from tests.benchmarks.virtual_calibration import robot_that_stands, verification_of

pytestmark = pytest.mark.benchmark

ROBOTS = int(os.environ.get("ROBOTS", "10"))
CELLS = os.environ.get("MECHANISMS", "simulated-hexaglide gough-stewart linapod rotary-cranks").split()
FAULTY = 100
"""Robots with one number out by twice its tolerance."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """What came of a robot; ``outside``: records at which the ball left the gauges' travel."""

    found: Identification | None = None
    truth: Geometry | None = None
    outside: int = 0
    is_refused: bool = False
    verdict: Verdict | None = None
    true_mm: float = np.nan
    value_mm: float = np.nan
    u_mm: float = np.nan
    limit_mm: float = np.nan
    reason: str = ""

    @property
    def shares(self) -> Array:
        """Errors of the free parameters (p,) in units of the bound: the noise's and tolerances' share."""
        assert self.found is not None
        assert self.truth is not None
        convention = self.found.problem.mechanism.convention
        error = self.found.free - convention.free_parameters(self.truth)
        return np.asarray(error / np.sqrt(np.diag(self.found.free_covariance)))


def calibrated(cell: Cell, robot: Robot, number: int) -> Calibrated:
    random = np.random.default_rng([15, number])
    truth = robot_that_stands(cell, robot, random)
    virtual = VirtualRobot(robot, truth, random)
    campaign = VirtualCampaign(Plan(cell.settings, robot, with_forecast=False), virtual)
    try:
        campaign.carry_out()
        found = identify(campaign.plan.robot.problem(campaign.measurements))
        one = Calibrated(found, truth, campaign.outside)
        one = replace(one, is_refused=bool(robot.tolerance_violations(found.estimate)))
        written = as_written(cell.settings, robot, found.geometry).geometry
        after = make_robot(cell.settings, ControllerGeometry(written, robot.branch), taught=written)
        verified = verification_of(cell.settings, found, (robot, after), (truth, random))
    except HexacellError as failed:
        return Calibrated(outside=campaign.outside, reason=str(failed))
    failures = ", ".join(test.sentence for test in verified.tests if not test.passed)
    if verified.accuracy is None:
        return replace(one, verdict=verified.verdict, reason=failures or "no accuracy")
    belief = after.belief(found)
    task = Task.of(cell.settings, after, belief).reachable(belief)
    budget = task.budget(found, belief, after.effects, {})
    assert budget is not None
    errors = budget.errors_of(found.free - robot.mechanism.convention.free_parameters(truth))
    return replace(
        one,
        verdict=verified.verdict,
        true_mm=errors.position.value,
        value_mm=verified.accuracy.position.value,
        u_mm=verified.accuracy.position.expanded,
        limit_mm=verified.accuracy.position.limit,
        reason=failures,
    )


@cache
def robots_of(name: str) -> tuple[Robot, tuple[Calibrated, ...]]:
    """The robot as drawn, and what came of those built after it."""
    cell = load_cell(bundled_config(name))
    robot = robot_of(cell)
    return robot, tuple(calibrated(cell, robot, number) for number in range(ROBOTS))


@pytest.mark.parametrize("name", CELLS)
def test_robots_within_the_tolerances_are_identified_and_none_is_wrong(say, name: str) -> None:
    _, every = robots_of(name)
    judged = [one for one in every if np.isfinite(one.true_mm)]
    for number, one in enumerate(every):
        if one.verdict is not Verdict.PASS:
            say(f"  robot {number}", f"{one.true_mm:.3f}; {one.value_mm:.3f} +- {one.u_mm:.3f}", one.reason)
    passed = sum(one.verdict is Verdict.PASS for one in every)
    wrong = sum(one.verdict is Verdict.PASS and not one.true_mm <= one.limit_mm for one in every)
    covered = sum(abs(one.value_mm - one.true_mm) <= one.u_mm for one in judged)
    say(f"{name}: identified", f"{sum(one.found is not None for one in every)} of {ROBOTS}", "all")
    say(f"{name}: pass", f"{passed} of {ROBOTS}", "reported")
    say(f"{name}: pass though the error is above the limit", f"{wrong}", "none")
    say(f"{name}: true error within U of the stated one", f"{covered} of {len(judged)}", "reported")
    say(
        f"{name}: largest true error at the task",
        f"{max(one.true_mm for one in judged):.3f} mm",
        "reported",
    )
    assert all(one.found is not None for one in every)
    assert not wrong


@pytest.mark.parametrize("name", CELLS)
def test_errors_are_those_of_the_bound(say, name: str) -> None:
    """Over all robots and parameters; the bound is that of the records and the tolerances together."""
    _, every = robots_of(name)
    shares = np.array([one.shares for one in every if one.found is not None])
    ratio = float(np.sqrt(np.mean(shares**2)))
    say(f"{name}: rms error over the bound", f"{ratio:.3f}", "0.95 to 1.06, of 100 robots")
    spread = 0.055 * max(1.0, 10.0 / np.sqrt(len(shares)))
    assert abs(ratio - 1.005) < spread


@pytest.mark.parametrize("name", CELLS)
def test_no_record_is_outside_the_travel_and_no_robot_is_refused(say, name: str) -> None:
    _, every = robots_of(name)
    outside, refused = sum(one.outside for one in every), sum(one.is_refused for one in every)
    say(f"{name}: records outside the travel", f"{outside}", "none")
    say(f"{name}: robots inside their tolerances refused", f"{refused} of {ROBOTS}", "none")
    assert outside == 0
    assert refused == 0


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("what", ["number", "joint"])
def test_a_robot_out_by_twice_its_tolerance_is_refused_and_its_leg_named(say, name: str, what: str) -> None:
    """One number of a leg, or all coordinates of one of its joints, one length or one zero.

    The others are within the tolerances, and all are known as well as after a calibration.
    """
    robot, every = robots_of(name)
    known = next(one.found for one in every if one.found is not None)
    found = [_found(robot, known, number, is_joint=what == "joint") for number in range(FAULTY)]
    refused, named, besides, refused_exactly, named_exactly = (
        sum(getattr(one, kind) for one in found)
        for kind in ("is_refused", "is_named", "is_among", "is_refused_exactly", "is_named_exactly")
    )
    refusable, nameable = (
        100.0 * float(np.mean(shares)) for shares in zip(*(one.bounds for one in found), strict=True)
    )
    say(f"{name}: a {what} out by twice its tolerance, refused", f"{refused} of {FAULTY}", "95, of a joint")
    say(f"{name}:   at most, by any test", f"{refusable:.1f} %", "reported")
    say(f"{name}:   were the robot known exactly", f"{refused_exactly} of {FAULTY}", "reported")
    say(f"{name}:   with the right leg named", f"{named} of {FAULTY}", "95, of a joint")
    say(f"{name}:   at most, by any test", f"{nameable:.1f} %", "reported")
    say(f"{name}:   were the robot known exactly", f"{named_exactly} of {FAULTY}", "reported")
    say(
        f"{name}:   with the right leg named, or among those named beside",
        f"{besides} of {FAULTY}",
        "reported",
    )
    assert refused_exactly >= (0.95 if what == "joint" else 0.75) * FAULTY
    assert named >= 0.5 * FAULTY
    if what == "joint":
        assert refused >= min(0.95, refusable / 100.0 - 0.03) * FAULTY
        assert besides >= min(0.95, refusable / 100.0 - 0.03) * FAULTY


@dataclass(frozen=True, slots=True)
class Found:
    """What is said of a robot with a fault; ``bounds``: the chances to refuse it and to name its leg."""

    is_refused: bool
    is_named: bool
    is_among: bool
    is_refused_exactly: bool
    is_named_exactly: bool
    bounds: tuple[float, float]


def _found(robot: Robot, known: Identification, number: int, *, is_joint: bool) -> Found:
    mechanism, random = robot.mechanism, np.random.default_rng([16, number])
    convention = mechanism.convention
    built, leg = _out_by_twice(robot, random, is_joint=is_joint)
    normal = mechanism.normalize_frames(built)[0]
    estimate = replace(
        known.estimate, geometry=convention.geometry(_estimate_of(normal, robot, known, random))
    )
    violations = robot.tolerance_violations(estimate)
    exact = replace(known.estimate, geometry=normal, covariance=0.0 * known.estimate.covariance)
    exactly = robot.tolerance_violations(exact)
    legs = {one.name: one.leg for one in mechanism.parameters.parameters}
    among = {
        int(digit) for one in violations for joint in one.instead for digit in joint if digit.isdigit()
    }
    return Found(
        bool(violations),
        leg in {legs[one.name] for one in violations},
        leg in {legs[one.name] for one in violations} | among,
        bool(exactly),
        leg in {legs[one.name] for one in exactly},
        largest_chances(robot, known, normal, leg),
    )


def _estimate_of(
    built: Geometry, robot: Robot, known: Identification, random: np.random.Generator
) -> Array:
    """Free parameters that records with the information of ``known`` give of another robot.

    Where the prior is not released, it draws them toward the drawing.
    """
    free, information = robot.mechanism.convention.free_parameters(built), known.solution.information
    values, directions = np.linalg.eigh(information)
    noise = directions @ (np.sqrt(np.maximum(values, 0.0)) * random.standard_normal(len(values)))
    pull = known.active_prior @ (robot.prior.free - free)
    return np.asarray(free + known.free_covariance @ (pull + noise))


def _out_by_twice(robot: Robot, random: np.random.Generator, *, is_joint: bool) -> tuple[Geometry, int]:
    """A robot of the tolerances but for one number, or one kind of numbers of one leg; and which leg."""
    parameters = robot.mechanism.parameters
    widths = robot.tolerances.widths(parameters)
    built = robot.drawing.vector + random.uniform(-widths, widths)
    wrong = parameters.parameters[int(random.integers(len(built)))]
    rows = [
        row
        for row, one in enumerate(parameters.parameters)
        if one == wrong or (is_joint and (one.kind, one.leg) == (wrong.kind, wrong.leg))
    ]
    signs = random.choice([-1.0, 1.0], len(rows))
    built[rows] = robot.drawing.vector[rows] + 2.0 * widths[rows] * signs
    return Geometry(parameters, built), wrong.leg
