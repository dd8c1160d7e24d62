"""A watched virtual robot: what it is commanded to, and where that brings passive joints and legs."""

from dataclasses import dataclass

import numpy as np

from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.motion.trajectory import interpolate_line
from hexacell.robot.model import Robot
from hexacell.robot.virtual_robot import VirtualRobot

PIECES = 24
"""Of a way, at whose ends a stop is tried."""


@dataclass
class Seen:
    """The worst at all ends of moves: of commands, and of the real robot. Angles in deg.

    ``way_is_kept`` is whether a stop on a way between two ends that keep tilt, turn, axes and joints would
    keep them too. ``margin`` is the smallest singularity margin of the real robot along all moves.
    """

    moves: int = 0
    tilt: float = 0.0
    turn: float = 0.0
    axis_is_kept: bool = True
    joint_is_kept: bool = True
    way_is_kept: bool = True
    spare: float = np.inf
    distance_mm: float = np.inf
    margin: float = np.inf


class WatchedRobot(VirtualRobot):
    """A virtual robot that notes what its limits say of the end of each move, in ``seen``."""

    def __init__(
        self, model: Robot, truth: Geometry, random: np.random.Generator, seen: Seen | None = None
    ) -> None:
        super().__init__(model, truth, random)
        self.seen = Seen() if seen is None else seen

    def place(self, command: Pose) -> None:
        super().place(command)
        self._note()

    def move(self, command: Pose) -> None:
        start = self.command
        super().move(command)
        self._note()
        self._note_way(PoseBatch.of([start]), PoseBatch.of([command]))

    def _stop(self, command: Pose, way: Array, poses: PoseBatch) -> None:
        margins = singularity_margin(self.model.mechanism, self.truth, poses, way[-len(poses) :])
        self.seen.margin = min(self.seen.margin, float(margins.min()))
        super()._stop(command, way, poses)

    def _note_way(self, start: PoseBatch, end: PoseBatch) -> None:
        line = self.model.frames.poses(interpolate_line(start, end, PIECES))
        limits = self.model.limits
        kept = limits.allow_commands(line) & limits.allow_joints(self._joints(line))
        self.seen.way_is_kept &= bool(kept.all() or not kept[[0, -1]].all())

    def _note(self) -> None:
        model, seen, limits = self.model, self.seen, self.model.limits
        command, commands = PoseBatch.of([self.command]), self._commanded
        joints = self._joints(commands)
        assert limits.legs is not None
        legs = model.mechanism.legs(self.truth, self._actual_pose, joints)
        seen.moves += 1
        seen.tilt = max(seen.tilt, float(np.degrees(command.tilts()[0])))
        seen.turn = max(seen.turn, float(np.degrees(np.abs(command.turns()[0]))))
        seen.axis_is_kept &= bool(limits.axes.allow(command)[0])
        seen.joint_is_kept &= bool(limits.allow_joints(joints)[0])
        seen.spare = min(seen.spare, float(np.degrees(limits.legs.margins(legs)[:, :12].min())))
        seen.distance_mm = min(seen.distance_mm, float(legs.smallest_distance()[0]))


def watch(campaign: VirtualCampaign, random: np.random.Generator) -> WatchedRobot:
    """Have a campaign carried out on a watched robot of the same geometry."""
    watched = WatchedRobot(campaign.plan.robot, campaign.virtual_robot.truth, random)
    campaign.virtual_robot = watched
    return watched
