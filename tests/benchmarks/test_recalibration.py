"""One machine calibrated five times in a row: each time it is as good as before, and is said to be.

The bundled cell, whose records have noise and nothing else wrong with them; the limit is 0.15 mm on the
largest error at a task pose. Each result is written as a run writes it, in the frames in which the task
poses move least: how far they still move, by the machine's own equations, is measured too, and how far they
would in the convention's frames.
"""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot.model import Robot, robot_of
from tests.benchmarks.figures import NEVER, at_least, at_most, least_by_chance
from tests.benchmarks.machines import bundled, on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.virtual_calibration import Judged, by_leg_equations, judged, robot_that_stands
from tests.benchmarks.worlds.closure import Bodies, CannotCloseError, follow, slider_places

MACHINES = sample(__name__, "MACHINES")
TIMES = 5
LIMIT_MM = bundled().settings.acceptance.position_mm
PASSES = 0.99


@dataclass(frozen=True, slots=True)
class Calibration:
    """What was stated once, and what was true.

    ``moved_mm`` is how far the farthest task pose moved, at the joint variables of the
    previous config, and ``moved_by_convention_mm`` how far in the convention's frames.
    """

    machine: int
    time: int
    judged: Judged
    moved_mm: float = np.nan
    moved_by_convention_mm: float = np.nan


def calibrations(number: int) -> list[Calibration]:
    """Of a machine that can stand at all points, within its limits, as its controller sends it there."""
    cell = bundled()
    robot = robot_of(cell)
    truth = robot_that_stands(cell, robot, np.random.default_rng([7, number]))
    every = []
    for time in range(TIMES):
        one = judged(cell, robot, truth, np.random.default_rng([8, number, time]), by_leg_equations)
        if one.done is None:
            every.append(Calibration(number, time, one))
            continue
        after = one.done.after
        by_convention = robot.for_controller(one.done.found.geometry)
        moved = (_moved(cell, robot, geometry) for geometry in (after.controller, by_convention))
        # What it consists of cannot be sent to another process.
        every.append(Calibration(number, time, replace(one, done=None), *moved))
        robot = after
    return every


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
    passed = [one.judged for one in every if one.judged.is_accepted]
    known = [one for one in every if one.judged.is_stated]
    for one in every:
        if not (says := one.judged).is_accepted:
            words = f"  machine {one.machine}, time {one.time + 1}: {says.verdict}, U {says.u_mm:.3f}"
            figure(f"{words}; {' '.join((says.reason, *says.unmet))}", says.true_mm, "mm")
    for time in range(TIMES):
        each = [one.judged for one in known if one.time == time]
        figure(f"time {time + 1}: largest error, median", np.median([one.true_mm for one in each]), "mm")
        figure(f"time {time + 1}: U, median", np.median([one.u_mm for one in each]), "mm")
    least = at_least(least_by_chance(PASSES, len(every)))
    figure("passes without a person", len(passed), f"of {len(every)}", least)
    figure("  true error within U", sum(one.judged.is_covered for one in known), f"of {len(known)}")
    figure("  false passes", sum(one.is_false_pass for one in passed), "", NEVER)
    again = [one for one in known if one.time > 0]
    moved = np.median([one.moved_mm for one in again])
    figure("  farthest task pose moved by a further calibration, median", moved, "mm", at_most(LIMIT_MM))
    share = np.median([one.moved_mm / one.moved_by_convention_mm for one in again])
    figure("  share of that in the convention's frames, median", share, "", at_most(0.5))
