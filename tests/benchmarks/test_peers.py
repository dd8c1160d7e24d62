"""Other methods and libraries against this program, on the same robots and records.

Robots are drawn within the bundled cell's tolerances; each method is given the same 55 records of them, in
poses that are chosen in three ways, see ``peers.robots``. Errors are those at held-out poses.
"""

import time
from dataclasses import dataclass

import numpy as np
import pytest

from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from tests.benchmarks.figures import at_most
from tests.benchmarks.peers.robots import Solve, StudiedRobot
from tests.benchmarks.samples import sample

ROBOTS = sample(__name__, "ROBOTS")
CHOSEN, AIMED, RANDOM = WAYS = ("chosen", "aimed", "random")
OURS, IPOPT, CERES = "hexacell", "CasADi, IPOPT", "Ceres"
PAPER, WHOLE_POSES = "the paper's least squares", "whole poses measured"


@dataclass(frozen=True)
class Result:
    """Errors of one method with one set of records, mm, infinite where it found nothing."""

    rms_mm: float = np.inf
    largest_mm: float = np.inf
    seconds: float = np.nan


def peers() -> dict[str, Solve]:
    """All but ours, which is given the records themselves."""
    pytest.importorskip("casadi", reason="make bench installs it")
    pytest.importorskip("pyceres", reason="make bench installs it")
    from tests.benchmarks.peers import casadi_poses, ceres_poses, full_poses, paper_least_squares

    return {
        IPOPT: casadi_poses.solve,
        CERES: ceres_poses.solve,
        PAPER: paper_least_squares.solve,
        WHOLE_POSES: full_poses.solve,
    }


def studied_robots() -> list[tuple[StudiedRobot, dict[str, MeasurementSet]]]:
    """So many robots with their records; one that cannot give them is passed over."""
    found: list[tuple[StudiedRobot, dict[str, MeasurementSet]]] = []
    number = 0
    while len(found) < ROBOTS:
        robot = StudiedRobot.drawn(number)
        try:
            found.append((robot, {CHOSEN: robot.chosen(), AIMED: robot.aimed(), RANDOM: robot.random()}))
        except HexacellError as error:
            print(f"robot {number} is passed over: {error}")
        number += 1
    return found


def solved(robot: StudiedRobot, measured: MeasurementSet, solve: Solve | None) -> Result:
    """What a peer, or without one this program, makes of some records."""
    records = robot.records(measured)
    begun = time.perf_counter()
    try:
        found: Array
        found = identify(robot.robot.problem(measured)).geometry.vector if solve is None else solve(records)
    except (ArithmeticError, HexacellError):
        return Result()
    seconds = time.perf_counter() - begun
    errors = robot.errors_mm(found)
    return Result(float(np.sqrt(np.mean(errors**2))), float(errors.max()), seconds)


def test_methods_on_the_same_records(figure) -> None:
    robots, methods = studied_robots(), {OURS: None, **peers()}
    results = {
        (name, way): [solved(robot, measured[way], solve) for robot, measured in robots]
        for name, solve in methods.items()
        for way in WAYS
    }
    medians: dict[tuple[str, str], float] = {}
    for (name, way), every in results.items():
        words = f"{name}, {way} poses"
        medians[name, way] = float(np.median([one.rms_mm for one in every]))
        figure(f"{words}: error at held-out poses, rms", medians[name, way], "mm")
        figure(f"{words}: largest", np.median([one.largest_mm for one in every]), "mm")
        figure(f"{words}: time", np.nanmedian([one.seconds for one in every]), "s")
        figure(f"{words}: no solution", sum(one.rms_mm == np.inf for one in every), f"of {ROBOTS}")
    for way in (CHOSEN, AIMED):
        pairs = zip(results[IPOPT, way], results[CERES, way], strict=True)
        apart = max(abs(one.rms_mm - other.rms_mm) for one, other in pairs)
        figure(f"IPOPT and Ceres, {way} poses: rms errors differ by", apart, "mm", at_most(1e-6))
    most = at_most(1.05 * medians[IPOPT, CHOSEN])
    figure("ours beside IPOPT with the exact noise model", medians[OURS, CHOSEN], "mm", most)
    others = min(medians[name, RANDOM] for name in methods if name != WHOLE_POSES)
    figure("the best method in random poses", others, "mm")
    figure("ours in chosen poses", medians[OURS, CHOSEN], "mm", at_most(others / 3.0))
