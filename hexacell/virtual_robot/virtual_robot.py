"""Robots as they may have been built: the drawing with errors within its tolerances.

A robot whose geometry is known, driven by a controller that knows another: no hardware, no noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.errors import LimitError, ReachError
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import PARAMETER_NAMES, Geometry
from hexacell.kinematics.inverse import inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.measurements.records import Record
from hexacell.motion.trajectory import LineBatch, interpolate_line, trace_path
from hexacell.robot_model import Robot

AS_DRAWN_MM = 1e-3
WORN = 0.1
"""Of the tolerances: how far a robot may have drifted since it was calibrated."""


def drawn_robots(robot: Robot, count: int, seed: int) -> list[Geometry]:
    """Geometries in the mechanism's frame convention, errors uniform within the tolerances.

    A controller whose geometry is not the drawing's was calibrated before: then errors are a part
    of the tolerances, and away from what the controller has.
    """
    random = np.random.default_rng(seed)
    convention, tolerances = robot.mechanism.convention, robot.tolerances
    names = convention.free_names()
    widths = tolerances.widths()[[PARAMETER_NAMES.index(name) for name in names]]
    of_ball = np.array([[name[0] == "B" and name[-1] == axis for name in names] for axis in "xyz"])
    centre = convention.free_parameters(robot.belief().controller)
    as_drawn = np.abs(centre - convention.free_parameters(robot.prior.centre)).max() < AS_DRAWN_MM
    share = 1.0 if as_drawn else WORN
    drawn = []
    for _ in range(count):
        ball = random.uniform(-tolerances.ball_mm, tolerances.ball_mm, 3)
        free = centre + share * (random.uniform(-widths, widths) + ball @ of_ball)
        drawn.append(Geometry.from_vector(convention.basis() @ free))
    return drawn


@dataclass(frozen=True, eq=False)
class VirtualRobot:
    """A robot that is known exactly, behind the controller of the one that is not.

    Attributes:
        truth: its geometry, in the mechanism's frame convention.
    """

    robot: Robot
    truth: Geometry

    def actual_poses(self, commands: PoseBatch) -> tuple[PoseBatch, Mask]:
        """Where it goes (n) for commands in the convention's frames, and whether it can (n,)."""
        poses, found, margin = self._gone(commands)
        # A pose is chosen under the limit itself; what cannot be chosen may have half of it.
        stands: Mask = found & (margin >= 0.5 * self.robot.limits.singularity_margin)
        return poses, stands

    def margin(self, command: PoseBatch) -> float:
        """Its singularity margin at a command (1); 0 where it cannot go."""
        _, found, margin = self._gone(command)
        return float(margin[0]) if found[0] else 0.0

    def _gone(self, commands: PoseBatch) -> tuple[PoseBatch, Mask, Array]:
        robot, belief = self.robot, self.robot.belief()
        joints = robot.mechanism.inverse(belief.controller, robot.branch, commands)
        really = continue_solution(
            robot.mechanism,
            self.truth,
            joints,
            start=commands,
            start_geometry=belief.controller,
            start_joints=joints,
        )
        margin = singularity_margin(robot.mechanism, self.truth, really.poses, joints)
        return really.poses, really.found, margin

    def measured(
        self, label: tuple[int, int], command: Pose, zero: Array | None, random: np.random.Generator
    ) -> tuple[Record, Array]:
        """The record of a pose in the controller's frames, and what the gauges showed (3,), mm.

        ``zero`` (3,) is what they showed at the reference; none at the reference itself.

        Raises:
            ReachError: it cannot stand there.
        """
        robot = self.robot
        commands = robot.from_commands([command])
        poses, stands = self.actual_poses(commands)
        if not stands[0]:
            raise ReachError(f"this robot cannot stand at {command}")
        joints = robot.mechanism.inverse(robot.belief().controller, robot.branch, commands)[0]
        shown = robot.frames.base.T @ poses.positions[0]
        shown = shown + robot.noise.gauge_mm * random.standard_normal(3)
        q1, q2, q3, q4, q5, q6 = (
            float(q) for q in joints + robot.noise.encoder_mm * random.standard_normal(6)
        )
        x, y, z = (float(value) for value in (shown - (shown if zero is None else zero)))
        return Record(*label, command, (q1, q2, q3, q4, q5, q6), (x, y, z)), shown


PIECES = 24


class StudiedMachine:
    """Goes where it is commanded, along the controller's straight lines, on its assembly mode.

    Attributes:
        smallest_margin: singularity margin of the true geometry, the least met on the way so far.
    """

    def __init__(self, robot: Robot, truth: Geometry) -> None:
        self._robot = robot
        self._truth = truth
        self._controller, _ = robot.mechanism.normalize_frames(robot.controller)
        self._command: PoseBatch | None = None
        self._real: PoseBatch | None = None
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
        found = continue_solution(
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
        goal = PoseBatch.of([command])
        if self._command is None:
            self._begin(goal)
        else:
            self._travel(interpolate_line(self._command, goal, PIECES))
        self._command = goal

    def _begin(self, goal: PoseBatch) -> None:
        joints = self._joints(goal)
        found = continue_solution(
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

    def _travel(self, way: PoseBatch) -> None:
        joints = self._joints(way)
        went = trace_path(
            self._robot.mechanism,
            self._truth,
            LineBatch.from_poses(way, 1),
            joints[:, None],
            self._standing,
        )
        if not went.found[0]:
            raise LimitError("the way leads into a singularity")
        poses = went.actual.flat()
        self._notice(poses, joints)
        self._real = poses[[-1]]

    def _notice(self, poses: PoseBatch, joints: Array) -> None:
        margin = singularity_margin(self._robot.mechanism, self._truth, poses, joints)
        self.smallest_margin = min(self.smallest_margin, float(margin.min()))

    def _joints(self, poses: PoseBatch) -> Array:
        return inverse_kinematics(self._robot.mechanism, self._controller, self._robot.branch, poses)

    @property
    def _standing(self) -> PoseBatch:
        if self._real is None:
            raise LimitError("the machine was not sent anywhere yet")
        return self._real

    @property
    def _commanded(self) -> PoseBatch:
        if self._command is None:
            raise LimitError("the machine was not sent anywhere yet")
        return self._command
