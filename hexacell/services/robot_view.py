"""What there is to see of a robot: as it is now, or in a run, with what was measured and changed."""

from dataclasses import dataclass, replace

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.drawing.robot_scene import DrawnRobot, robot_scene
from hexacell.drawing.shapes import Role, Scene
from hexacell.errors import HexacellError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from hexacell.services.history.recorded_cell import started_robot
from hexacell.services.history.reported_run import ReportedRun
from procedures.run.keys import Phase

NAMES = {
    Phase.IDENTIFY: (Role.BEFORE, "records"),
    Phase.BEFORE: (Role.BEFORE, "held-out poses as found"),
    Phase.AFTER: (Role.AFTER, "held-out poses as left"),
}
"""What is measured with the geometry before and after a calibration."""


@dataclass(frozen=True, slots=True, eq=False)
class Deviations:
    """Where the ball should have been (n, 3), mm, and the vectors to where it was, in what is named so."""

    role: Role
    name: str
    planned: Array
    vectors: Array


@dataclass(frozen=True, slots=True, eq=False)
class RobotView:
    """A robot, all in the frames of its controller.

    Attributes:
        title: the name of the cell, and of the run.
        robot: with the geometry that is, or is to be, in the controller.
        poses: those of the task that it reaches, or its points where the cell states no task.
        before: the robot with the geometry that commanded before; None where no other was proposed.
        measured: what was measured, phase by phase; empty for a cell.
    """

    title: str
    robot: DrawnRobot
    poses: tuple[Pose, ...]
    before: DrawnRobot | None = None
    measured: tuple[Deviations, ...] = ()


def drawn_robot(robot: Robot, settings: CellSettings) -> DrawnRobot:
    """A robot with the geometry of its controller, as its cell file mounts the gauges."""
    low, high = (
        np.broadcast_to(one, robot.mechanism.joint_count)
        for one in (robot.limits.joint_min, robot.limits.joint_max)
    )
    x, y, z = (gauge.sign for gauge in sorted(settings.gauges, key=lambda gauge: gauge.axis))
    return DrawnRobot(robot.mechanism, robot.controller, robot.branch, low, high, (x, y, z))


def view_of_cell(cell: Cell) -> RobotView:
    """The robot of a cell as its controller knows it now; raises ``FileError`` if its config is absent."""
    robot = drawn_robot(robot_of(cell), cell.settings)
    return RobotView(cell.settings.name, robot, _poses(robot, cell.settings))


def first_scene(cell: Cell) -> Scene | None:
    """The robot of a cell at the first of its poses; None where it cannot be drawn."""
    try:
        view = view_of_cell(cell)
        return robot_scene(view.robot, view.poses[0])
    except HexacellError:
        return None


def view_of_run(run: ReportedRun) -> RobotView:
    """The robot of a run, before and after it, with what was measured."""
    robot, before = drawn_robot(started_robot(run.settings, run.started), run.settings), None
    if (proposed := run.state.proposed) is not None:
        written = Geometry.of(robot.mechanism.parameters, proposed.written)
        robot, before = replace(robot, geometry=written), robot
    measured = tuple(one for phase in NAMES if (one := _deviations(run, phase)) is not None)
    title = f"{run.settings.name} / {run.name}"
    return RobotView(title, robot, _poses(robot, run.settings), before, measured)


def _deviations(run: ReportedRun, phase: Phase) -> Deviations | None:
    """What a phase measured but its references, which are the gauges' zeros; None where that is nothing."""
    if not (taken := [one for one in run.state.samples(phase) if one.orientation > 1]):
        return None
    planned, vectors = ([one.pose[:3] for one in taken], [one.deviation_mm for one in taken])
    return Deviations(*NAMES[phase], np.array(planned), np.array(vectors))


def _poses(robot: DrawnRobot, settings: CellSettings) -> tuple[Pose, ...]:
    """Those within reach; all if there are none, so that whoever draws the first is told which leg ends."""
    points = [(*point, 0.0, 0.0, 0.0) for point in settings.identification.points]
    poses = [Pose(*one) for one in settings.task.poses or points]
    joints = robot.mechanism.inverse(robot.geometry, robot.branch, PoseBatch.of(poses))
    reached = [pose for pose, row in zip(poses, joints, strict=True) if np.isfinite(row).all()]
    return tuple(reached or poses)
