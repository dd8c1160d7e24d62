"""Every mechanism that comes with the package: robots drawn within the tolerances of its bundled cell.

Each is calibrated as a run does it, with the limits and the noise of the cell, and its result is verified.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from hexacell.cell.loader import Cell
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from hexacell.verdict.decision import Verdict
from tests.benchmarks.figures import NEVER, at_least, between
from tests.benchmarks.machines import bundled
from tests.benchmarks.samples import sample
from tests.benchmarks.tolerance_bound import largest_chances
from tests.benchmarks.virtual_calibration import Judged, by_derivatives, judged, robot_that_stands

ROBOTS = sample(__name__, "ROBOTS")
CELLS = os.environ.get("MECHANISMS", "simulated-hexaglide gough-stewart linapod rotary-cranks").split()
FAULTY = 100
"""Robots with one number out by twice its tolerance."""


def shares(one: Judged) -> Array:
    """Errors of the free parameters (p,) in units of the bound: the noise's and tolerances' share."""
    assert one.done is not None
    found = one.done.found
    error = found.free - found.problem.mechanism.convention.free_parameters(one.truth)
    return np.asarray(error / np.sqrt(np.diag(found.free_covariance)))


def calibrated(cell: Cell, robot: Robot, number: int) -> Judged:
    random = np.random.default_rng([15, number])
    return judged(cell, robot, robot_that_stands(cell, robot, random), random, by_derivatives)


@cache
def robots_of(name: str) -> tuple[Robot, tuple[Judged, ...]]:
    """The robot as drawn, and what came of those built after it."""
    cell = bundled(name)
    robot = robot_of(cell)
    return robot, tuple(calibrated(cell, robot, number) for number in range(ROBOTS))


@pytest.mark.parametrize("name", CELLS)
def test_robots_within_the_tolerances_are_identified_and_none_is_wrong(figure, name: str) -> None:
    _, every = robots_of(name)
    known = [one for one in every if np.isfinite(one.true_mm)]
    for number, one in enumerate(every):
        if one.verdict is not Verdict.PASS:
            figure(f"  robot {number}: U {one.u_mm:.3f} mm; {one.reason}", one.true_mm, "mm")
    passed = sum(one.verdict is Verdict.PASS for one in every)
    wrong, covered = sum(one.is_false_pass for one in every), sum(one.is_covered for one in known)
    identified = sum(one.done is not None for one in every)
    figure(f"{name}: identified", identified, f"of {ROBOTS}", at_least(ROBOTS))
    figure(f"{name}: pass", passed, f"of {ROBOTS}")
    figure(f"{name}: pass though the error is above the limit", wrong, "", NEVER)
    figure(f"{name}: true error within U of the stated one", covered, f"of {len(known)}")
    figure(f"{name}: largest true error at the task", max(one.true_mm for one in known), "mm")


@pytest.mark.parametrize("name", CELLS)
def test_errors_are_those_of_the_bound(figure, name: str) -> None:
    """Over all robots and parameters; the bound is that of the records and the tolerances together."""
    _, every = robots_of(name)
    ratios = np.array([shares(one) for one in every if one.done is not None])
    ratio = float(np.sqrt(np.mean(ratios**2)))
    spread = 0.055 * max(1.0, 10.0 / np.sqrt(len(ratios)))
    figure(f"{name}: rms error over the bound", ratio, "", between(1.005 - spread, 1.005 + spread))


@pytest.mark.parametrize("name", CELLS)
def test_no_record_is_outside_the_travel_and_no_robot_is_refused(figure, name: str) -> None:
    _, every = robots_of(name)
    figure(f"{name}: records outside the travel", sum(one.outside for one in every), "", NEVER)
    refused = sum(one.is_refused for one in every)
    figure(f"{name}: robots inside their tolerances refused", refused, f"of {ROBOTS}", NEVER)


@pytest.mark.parametrize("name", CELLS)
@pytest.mark.parametrize("what", ["number", "joint"])
def test_a_robot_out_by_twice_its_tolerance_is_refused_and_its_leg_named(
    figure, name: str, what: str
) -> None:
    """One number of a leg, or all coordinates of one of its joints, one length or one zero.

    The others are within the tolerances, and all are known as well as after a calibration.
    """
    robot, every = robots_of(name)
    known = next(one.done.found for one in every if one.done is not None)
    found = [_found(robot, known, number, is_joint=what == "joint") for number in range(FAULTY)]
    refusable, nameable = (
        float(np.mean(shares)) for shares in zip(*(one.bounds for one in found), strict=True)
    )
    is_joint, best = what == "joint", min(0.95, refusable - 0.03) * FAULTY
    for kind, words, least in (
        ("is_refused", "refused", best if is_joint else None),
        (
            "is_refused_exactly",
            "refused were the robot known exactly",
            (0.95 if is_joint else 0.75) * FAULTY,
        ),
        ("is_named", "right leg named", 0.5 * FAULTY),
        ("is_named_exactly", "right leg named were the robot known exactly", None),
        ("is_among", "right leg named or among those named beside", best if is_joint else None),
    ):
        count, target = sum(getattr(one, kind) for one in found), None if least is None else at_least(least)
        figure(f"{name}: a {what} out by twice its tolerance, {words}", count, f"of {FAULTY}", target)
    figure(f"{name}: a {what}, refused at most by any test", refusable)
    figure(f"{name}: a {what}, leg named at most by any test", nameable)


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
