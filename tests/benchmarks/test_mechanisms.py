"""Every mechanism that comes with the package: robots drawn within the tolerances of its bundled cell.

Each is calibrated as a run does it, with the limits and the noise of the cell, and its result is verified.
"""

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import pytest

from hexacell.campaign.planner import Plan
from hexacell.dry_run.campaign import dry_run
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from hexacell.verdict.decision import Verdict
from tests.benchmarks.figures import NEVER, at_least, between, least_by_chance
from tests.benchmarks.machines import bundled, on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.tolerance_bound import largest_chances
from tests.benchmarks.virtual_calibration import Judged, by_derivatives, judged, robot_that_stands

ROBOTS = sample(__name__, "ROBOTS")
CELLS = ("simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks", "five-legs", "four-arms")
FAULTY = sample(__name__, "FAULTY")
"""Robots with one joint out by twice its tolerance."""
ALLOWANCE = 1.5 / FAULTY
"""Of every share: one robot more or less is no finding."""


def calibrated(name: str, number: int) -> Judged:
    cell, random = bundled(name), np.random.default_rng([15, number])
    robot = robot_of(cell)
    return judged(cell, robot, robot_that_stands(cell, robot, random), random, by_derivatives)


def calibrated_with_shares(name: str, number: int) -> tuple[Judged, Array | None]:
    """Errors of the free parameters (p,) come in units of the bound: of noise and tolerances together."""
    one = calibrated(name, number)
    if one.done is None:
        return one, None
    found = one.done.found
    error = found.free - found.problem.mechanism.convention.free_parameters(one.truth)
    # What it consists of cannot be sent to another process.
    return replace(one, done=None), error / np.sqrt(np.diag(found.free_covariance))


@pytest.mark.parametrize("name", CELLS)
def test_robots_within_the_tolerances_are_identified_and_none_is_wrong(figure, name: str) -> None:
    pairs = on_all_cores(partial(calibrated_with_shares, name), range(ROBOTS))
    every, shares = [one for one, _ in pairs], [share for _, share in pairs if share is not None]
    known = [one for one in every if one.is_stated]
    for number, one in enumerate(every):
        if not one.is_accepted:
            why = " ".join((one.reason, *one.unmet))
            figure(f"  robot {number}: U {one.u_mm:.3f} mm; {why}", one.true_mm, "mm")
    figure(f"{name}: identified", len(shares), f"of {ROBOTS}", at_least(ROBOTS))
    accepted = sum(one.is_accepted for one in every)
    figure(
        f"{name}: pass without a person", accepted, f"of {ROBOTS}", at_least(least_by_chance(0.99, ROBOTS))
    )
    plan = Plan(bundled(name).settings, robot_of(bundled(name)))
    verdicts = dry_run(plan).verdicts
    assert verdicts is not None
    passing, chance = verdicts.probabilities[Verdict.PASS], 3.0 * float(np.sqrt(0.25 / ROBOTS))
    near = between(accepted / ROBOTS - 0.05 - chance, accepted / ROBOTS + 0.05 + chance)
    figure(f"{name}: pass by the forecast of preflight, the share of robots beside it", passing, "", near)
    false = sum(one.is_false_pass for one in every)
    figure(f"{name}: pass though the error is above the limit", false, "", NEVER)
    figure(f"{name}: true error within U", sum(one.is_covered for one in known), f"of {len(known)}")
    figure(f"{name}: largest true error at the task", max(one.true_mm for one in known), "mm")
    ratio, spread = (
        float(np.sqrt(np.mean(np.square(shares)))),
        0.055 * max(1.0, 10.0 / np.sqrt(len(shares))),
    )
    figure(f"{name}: rms error over the bound", ratio, "", between(1.005 - spread, 1.005 + spread))
    figure(f"{name}: records outside the travel", sum(one.outside for one in every), "", NEVER)
    refused = sum(one.is_refused for one in every)
    figure(f"{name}: robots inside their tolerances refused", refused, f"of {ROBOTS}", NEVER)


@cache
def known_robot(name: str) -> tuple[Robot, Identification]:
    """The robot as drawn, and what is known of the first that is built after it."""
    done = calibrated(name, 0).done
    assert done is not None
    return robot_of(bundled(name)), done.found


@pytest.mark.parametrize("name", CELLS)
def test_a_robot_out_by_twice_its_tolerance_is_refused_and_its_leg_named(figure, name: str) -> None:
    """All coordinates of one of a leg's joints, one length or one zero are out.

    The others are within the tolerances, and all are known as well as after a calibration.
    """
    known_robot(name)  # once, before there are more processes
    found = on_all_cores(partial(refusal, name), range(FAULTY), together=5)
    refusable, nameable = np.mean([one.bounds for one in found], axis=0)
    least = at_least((min(0.95, refusable - 0.03) - ALLOWANCE) * FAULTY)
    refused, named = sum(one.is_refused for one in found), sum(one.is_named for one in found)
    words = f"{name}: a joint out by twice its tolerance"
    figure(f"{words}, refused", refused, f"of {FAULTY}", least)
    figure(f"{words}, right leg named or among those named beside", named, f"of {FAULTY}", least)
    figure(f"{name}: refused at most by any test", refusable)
    figure(f"{name}: leg named at most by any test", nameable)


@dataclass(frozen=True, slots=True)
class Refusal:
    """What is said of a robot with a fault; ``bounds``: the chances to refuse it and to name its leg."""

    is_refused: bool
    is_named: bool
    bounds: tuple[float, float]


def refusal(name: str, number: int) -> Refusal:
    (robot, known), random = known_robot(name), np.random.default_rng([16, number])
    built, leg = _out_by_twice(robot, random)
    normal = robot.mechanism.normalize_frames(built)[0]
    geometry = robot.mechanism.convention.geometry(_estimate_of(normal, robot, known, random))
    violations = robot.tolerance_violations(replace(known.estimate, geometry=geometry))
    legs = {one.name: one.leg for one in robot.mechanism.parameters.parameters}
    beside = {
        int(digit) for one in violations for joint in one.instead for digit in joint if digit.isdigit()
    }
    named = beside | {legs[one.name] for one in violations}
    return Refusal(bool(violations), leg in named, largest_chances(robot, known, normal, leg))


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


def _out_by_twice(robot: Robot, random: np.random.Generator) -> tuple[Geometry, int]:
    """A robot of the tolerances but for one kind of numbers of one leg; and which leg."""
    parameters = robot.mechanism.parameters
    widths = robot.tolerances.widths(parameters)
    built = robot.drawing.vector + random.uniform(-widths, widths)
    wrong = parameters.parameters[int(random.integers(len(built)))]
    rows = [
        row
        for row, one in enumerate(parameters.parameters)
        if (one.kind, one.leg) == (wrong.kind, wrong.leg)
    ]
    signs = random.choice([-1.0, 1.0], len(rows))
    built[rows] = robot.drawing.vector[rows] + 2.0 * widths[rows] * signs
    return Geometry(parameters, built), wrong.leg
