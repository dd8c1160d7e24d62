"""One machine calibrated five times in a row: each time it is as good as before, and is said to be.

The bundled cell, whose records have noise and nothing else wrong with them; the limit is 0.15 mm on the
largest error at a task pose. Each result is written as a run writes it, in the frames in which the task
poses move least: how far they still move, by the machine's own equations, is measured too, and how far they
would in the convention's frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot.model import Robot, robot_of
from hexacell.verdict.decision import Verdict
from tests.benchmarks.figures import NEVER, at_least, at_most
from tests.benchmarks.machines import bundled, on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import calibrate, robot_that_stands
from tests.benchmarks.worlds.closure import Bodies, CannotCloseError, follow, slider_places
from tests.benchmarks.worlds.effects import Effect
from tests.benchmarks.worlds.table import least_by_chance
from tests.benchmarks.worlds.world import World

MACHINES = sample(__name__, "MACHINES")
TIMES = 5
LIMIT_MM = bundled().settings.acceptance.position_mm
PASSES = 0.99


@dataclass(frozen=True, slots=True)
class Calibration:
    """What was stated once, and what was true; ``reason`` where nothing was stated.

    ``moved_mm`` is how far the farthest task pose moved, at the joint variables that it had with the config
    of before, and ``moved_by_convention_mm`` how far in the convention's frames.
    """

    machine: int
    time: int
    verdict: Verdict | None = None
    true_mm: float = np.nan
    value_mm: float = np.nan
    u_mm: float = np.nan
    ratio: float = np.nan
    records: int = 0
    moved_mm: float = np.nan
    moved_by_convention_mm: float = np.nan
    reason: str = ""


def calibrations(number: int) -> list[Calibration]:
    """Of a machine that can stand at all points, within its limits, as its controller sends it there."""
    cell = bundled()
    robot = robot_of(cell)
    truth = robot_that_stands(cell, robot, np.random.default_rng([7, number]))
    done = []
    for time in range(TIMES):
        calibration, robot = _calibrated(cell, robot, truth, Calibration(number, time))
        done.append(calibration)
    return done


def _calibrated(cell: Cell, robot: Robot, truth: Geometry, this: Calibration) -> tuple[Calibration, Robot]:
    """One calibration, and the robot with what was found in its controller."""
    random = np.random.default_rng([8, this.machine, this.time])
    try:
        done = calibrate(cell, robot, truth, random)
    except HexacellError as failed:
        return replace(this, reason=str(failed)), robot
    found, after = done.found, done.after
    if done.verification.accuracy is None:
        return replace(this, verdict=done.verification.verdict, reason="no accuracy"), after
    belief = after.belief(found)
    task = Task.of(cell.settings, after, belief).reachable(belief)
    world = World(after, truth, Effect(), 0)
    true = world.errors(found.geometry, task.poses, task.workspace).largest_mm
    position = done.verification.accuracy.position
    this = replace(
        this,
        verdict=done.verification.verdict,
        true_mm=true,
        value_mm=position.value,
        u_mm=position.expanded,
        ratio=found.goodness.ratio,
        records=done.records,
        moved_mm=_moved(cell, robot, after.controller),
        moved_by_convention_mm=_moved(cell, robot, robot.for_controller(found.geometry)),
    )
    return this, after


def _moved(cell: Cell, robot: Robot, written: Geometry) -> float:
    """How far the farthest task pose moves at its joint variables, mm, by the leg equations alone.

    Not a number where there is a singularity between the geometries, as with a drawing.
    """
    task = PoseBatch.of(Pose(*pose) for pose in cell.settings.task.poses)
    joints = slider_places(robot.controller, robot.branch, task)
    try:
        moved = follow(Bodies.of(robot.controller, joints), Bodies.of(written, joints), task)
    except CannotCloseError:
        return np.nan
    return float(np.linalg.norm(moved.positions - task.positions, axis=-1).max())


def test_a_machine_that_is_calibrated_again_and_again_passes_every_time(figure):
    every = [one for each in on_all_cores(calibrations, range(MACHINES)) for one in each]
    passed = [one for one in every if one.verdict is Verdict.PASS]
    stated_ones = [one for one in every if np.isfinite(one.true_mm)]
    for one in every:
        if one.verdict is not Verdict.PASS:
            words = f"  machine {one.machine}, time {one.time + 1}: {one.verdict}, U {one.u_mm:.3f}"
            figure(f"{words}; {one.reason}", one.true_mm, "mm")
    for time in range(TIMES):
        each = [one for one in stated_ones if one.time == time]
        for words, name in (
            ("largest error", "true_mm"),
            ("U", "u_mm"),
            ("farthest task pose moved", "moved_mm"),
            ("the same in the convention's frames", "moved_by_convention_mm"),
        ):
            values = [getattr(one, name) for one in each]
            figure(f"time {time + 1}: {words}, median", np.nanmedian(values), "mm")
    covered = sum(abs(one.value_mm - one.true_mm) <= one.u_mm for one in stated_ones)
    false = sum(one.true_mm > LIMIT_MM for one in passed)
    least = at_least(least_by_chance(PASSES, len(every)))
    figure("passes", len(passed), f"of {len(every)}", least)
    figure("  true error within U", covered, f"of {len(stated_ones)}")
    figure("  false passes", false, "", NEVER)
    again = [one for one in stated_ones if one.time > 0]
    moved = np.median([one.moved_mm for one in again])
    figure("  farthest task pose moved by a further calibration, median", moved, "mm", at_most(LIMIT_MM))
    share = np.median([one.moved_mm / one.moved_by_convention_mm for one in again])
    figure("  share of that in the convention's frames, median", share, "", at_most(0.5))
