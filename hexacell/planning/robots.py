"""Robots as they may have been built: the drawing with errors within its tolerances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell import kinematics
from hexacell.errors import ReachError
from hexacell.geometry import PARAMETER_NAMES, Geometry
from hexacell.measurements import Record
from hexacell.pose import Pose, Poses
from hexacell.robot import Robot
from hexacell.rotations import Array, Mask

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
    centre = convention.free_part(robot.knowledge().controller)
    as_drawn = np.abs(centre - convention.free_part(robot.prior.centre)).max() < AS_DRAWN_MM
    share = 1.0 if as_drawn else WORN
    drawn = []
    for _ in range(count):
        ball = random.uniform(-tolerances.ball_mm, tolerances.ball_mm, 3)
        free = centre + share * (random.uniform(-widths, widths) + ball @ of_ball)
        drawn.append(Geometry.from_vector(convention.basis() @ free))
    return drawn


@dataclass(frozen=True, eq=False)
class Built:
    """A robot that is known exactly, behind the controller of the one that is not.

    Attributes:
        truth: its geometry, in the mechanism's frame convention.
    """

    robot: Robot
    truth: Geometry

    def stands(self, commands: Poses) -> tuple[Poses, Mask]:
        """Where it goes (n) for commands in the convention's frames, and whether it can (n,)."""
        poses, found, margin = self._gone(commands)
        # A pose is chosen under the limit itself; what cannot be chosen may have half of it.
        stands: Mask = found & (margin >= 0.5 * self.robot.limits.singularity_margin)
        return poses, stands

    def margin(self, command: Poses) -> float:
        """Its singularity margin at a command (1); 0 where it cannot go."""
        _, found, margin = self._gone(command)
        return float(margin[0]) if found[0] else 0.0

    def _gone(self, commands: Poses) -> tuple[Poses, Mask, Array]:
        robot, knowledge = self.robot, self.robot.knowledge()
        joints = robot.mechanism.inverse(knowledge.controller, robot.branch, commands)
        really = kinematics.follow(
            robot.mechanism,
            self.truth,
            joints,
            start=commands,
            start_geometry=knowledge.controller,
            start_joints=joints,
        )
        margin = kinematics.singularity_margin(robot.mechanism, self.truth, really.poses, joints)
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
        commands = robot.change.poses(Poses.of([command]))
        poses, stands = self.stands(commands)
        if not stands[0]:
            raise ReachError(f"this robot cannot stand at {command}")
        joints = robot.mechanism.inverse(robot.knowledge().controller, robot.branch, commands)[0]
        shown = robot.change.base.T @ poses.positions[0]
        shown = shown + robot.noise.gauge_mm * random.standard_normal(3)
        q1, q2, q3, q4, q5, q6 = (
            float(q) for q in joints + robot.noise.encoder_mm * random.standard_normal(6)
        )
        x, y, z = (float(value) for value in (shown - (shown if zero is None else zero)))
        return Record(*label, command, (q1, q2, q3, q4, q5, q6), (x, y, z)), shown
