"""What there is to see of a robot: as it is now, or in a run, with what was measured and changed."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.drawing.robot_scene import DrawnRobot
from hexacell.drawing.shapes import Role
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import inverse_kinematics
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
    """How far the ball was from where it should have been, at some poses.

    Attributes:
        role: BEFORE or AFTER, by the geometry that commanded.
        name: what was measured, in a few words.
        planned: (n, 3) where the ball should have been, mm.
        vectors: (n, 3) from there to where the gauges showed it, mm.
    """

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
        before: the robot with the geometry that commanded before; None where none was identified.
        measured: what was measured, phase by phase; empty for a cell.
    """

    title: str
    robot: DrawnRobot
    poses: tuple[Pose, ...]
    before: DrawnRobot | None = None
    measured: tuple[Deviations, ...] = ()


def drawn_robot(robot: Robot, settings: CellSettings) -> DrawnRobot:
    """A robot with the geometry of its controller, as its cell file mounts the gauges."""
    lowest, highest = (np.broadcast_to(one, 6) for one in (robot.limits.joint_min, robot.limits.joint_max))
    x, y, z = (gauge.sign for gauge in sorted(settings.gauges, key=lambda gauge: gauge.axis))
    return DrawnRobot(robot.mechanism, robot.controller, robot.branch, lowest, highest, (x, y, z))


def view_of_cell(cell: Cell) -> RobotView:
    """The robot of a cell as its controller knows it now.

    Raises:
        FileError: the controller's config cannot be read.
        ReachError: the robot reaches none of its poses.
    """
    robot = drawn_robot(robot_of(cell), cell.settings)
    return RobotView(cell.settings.name, robot, _poses(robot, cell.settings))


def view_of_run(run: ReportedRun) -> RobotView:
    """The robot of a run, before and after it, with what was measured.

    Raises:
        ReachError: the robot reaches none of its poses.
    """
    started = started_robot(run.settings, run.started)
    before, title = drawn_robot(started, run.settings), f"{run.settings.name} / {run.name}"
    measured = tuple(one for phase in NAMES if (one := _deviations(run, phase)) is not None)
    if (found := _new_geometry(run, started)) is None:
        return RobotView(title, before, _poses(before, run.settings), measured=measured)
    robot = replace(before, geometry=found)
    return RobotView(title, robot, _poses(robot, run.settings), before, measured)


def _deviations(run: ReportedRun, phase: Phase) -> Deviations | None:
    """What a phase measured but its references, which are the gauges' zeros; None where that is nothing."""
    if not (taken := [one for one in run.state.samples(phase) if one.orientation > 1]):
        return None
    planned, vectors = ([one.pose[:3] for one in taken], [one.deviation_mm for one in taken])
    return Deviations(*NAMES[phase], np.array(planned), np.array(vectors))


def _new_geometry(run: ReportedRun, started: Robot) -> Geometry | None:
    """The geometry that was, or would be, written; None where none was identified."""
    proposed, identified = run.state.proposed, run.state.identified
    parameters = started.mechanism.parameters
    if proposed is not None:
        return Geometry.of(parameters, proposed.written)
    return None if identified is None else started.for_controller(identified.result.identified(parameters))


def _poses(robot: DrawnRobot, settings: CellSettings) -> tuple[Pose, ...]:
    stated: Iterable[Pose] = [Pose(*pose) for pose in settings.task.poses]
    poses = list(stated or (Pose(*point) for point in settings.identification.points))
    joints = robot.mechanism.inverse(robot.geometry, robot.branch, PoseBatch.of(poses))
    reached = tuple(pose for pose, row in zip(poses, joints, strict=True) if np.isfinite(row).all())
    if not reached:
        inverse_kinematics(robot.mechanism, robot.geometry, robot.branch, PoseBatch.of(poses))
    return reached
