"""The robot of a run, as the run knew it when it began."""

from __future__ import annotations

from hexacell.cell.model import CellSettings
from hexacell.config.interface import ControllerLimits
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import Robot, robot_of_start
from procedures.run.events import RunStarted


def started_robot(settings: CellSettings, started: RunStarted) -> Robot:
    """From a cell's settings, which may be newer, and what its controller had then."""
    limits = started.limits or ControllerLimits(joints=started.joint_ranges)
    return robot_of_start(settings, started.controller, started.branch, started.taught, limits)


def geometry_before(settings: CellSettings, started: RunStarted) -> Geometry:
    """That of the controller when the run began, in the mechanism's frame convention."""
    mechanism = settings.mechanism
    return mechanism.normalize_frames(Geometry.of(mechanism.parameters, started.controller))[0]
