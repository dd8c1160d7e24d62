"""A robot whose geometry is known, driven by a controller that knows another: no hardware, no noise."""

from __future__ import annotations

import numpy as np

from hexacell import kinematics
from hexacell.design.lines import Lines, course, straight
from hexacell.errors import LimitError
from hexacell.geometry import Geometry
from hexacell.pose import Pose, Poses
from hexacell.robot import Robot
from hexacell.rotations import Array

PIECES = 24


class StudiedMachine:
    """Goes where it is commanded, along the controller's straight lines, on its assembly mode.

    Attributes:
        smallest_margin: singularity margin of the true geometry, the least met on the way so far.
    """

    def __init__(self, robot: Robot, truth: Geometry) -> None:
        self._robot = robot
        self._truth = truth
        self._controller, _ = robot.mechanism.to_convention(robot.controller)
        self._command: Poses | None = None
        self._real: Poses | None = None
        self.smallest_margin = np.inf

    @property
    def joints(self) -> Array:
        """Where the sliders are (6,), mm."""
        return np.asarray(self._joints(self._commanded)[0])

    @property
    def ball(self) -> Array:
        """Where the ball really is (3,), mm."""
        return np.asarray(self._standing.positions[0])

    @property
    def tilt(self) -> float:
        """How far the platform is really tilted, rad."""
        return float(self._standing.tilts()[0])

    @property
    def believed(self) -> Pose:
        """Where the controller believes the platform to be, in the convention's frames."""
        return self._commanded.pose(0)

    def load(self, controller: Geometry) -> None:
        """Have the controller command with another geometry from now on; the sliders stay."""
        joints = self._joints(self._commanded)
        found = kinematics.follow(
            self._robot.mechanism,
            controller,
            joints,
            start=self._commanded,
            start_geometry=self._controller,
            start_joints=joints,
        )
        if not found.found[0]:
            raise LimitError("with this geometry the sliders cannot stand so")
        self._controller, self._command = controller, found.poses

    def go(self, command: Pose) -> None:
        """Move to a commanded pose; the first time, simply be there.

        Raises:
            LimitError: the way, or the first pose, leads out of reach or into a singularity.
        """
        goal = Poses.of([command])
        if self._command is None:
            self._begin(goal)
        else:
            self._travel(straight(self._command, goal, PIECES))
        self._command = goal

    def _begin(self, goal: Poses) -> None:
        joints = self._joints(goal)
        found = kinematics.follow(
            self._robot.mechanism,
            self._truth,
            joints,
            start=goal,
            start_geometry=self._controller,
            start_joints=joints,
        )
        if not found.found[0]:
            raise LimitError(f"the machine cannot stand at {goal.pose(0)}")
        self._real = found.poses
        self._notice(found.poses, joints)

    def _travel(self, way: Poses) -> None:
        joints = self._joints(way)
        went = course(self._robot.mechanism, self._truth, Lines.of(way, 1), joints[:, None], self._standing)
        if not went.found[0]:
            raise LimitError("the way leads into a singularity")
        poses = went.really.flat()
        self._notice(poses, joints)
        self._real = poses[[-1]]

    def _notice(self, poses: Poses, joints: Array) -> None:
        margin = kinematics.singularity_margin(self._robot.mechanism, self._truth, poses, joints)
        self.smallest_margin = min(self.smallest_margin, float(margin.min()))

    def _joints(self, poses: Poses) -> Array:
        return kinematics.inverse(self._robot.mechanism, self._controller, self._robot.branch, poses)

    @property
    def _standing(self) -> Poses:
        if self._real is None:
            raise LimitError("the machine was not sent anywhere yet")
        return self._real

    @property
    def _commanded(self) -> Poses:
        if self._command is None:
            raise LimitError("the machine was not sent anywhere yet")
        return self._command
