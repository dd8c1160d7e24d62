"""Commanded motion: the actual pose of a robot whose controller computes with another geometry.

The controller solves the inverse kinematics of its own geometry G_c for a commanded pose x_c and moves
the joints to q = IK(G_c, x_c). The platform of a robot with the geometry G_a then takes the pose

    x_a = FK(G_a, q),

and the command that brings the robot to a pose x_a is x_c = FK(G_c, IK(G_a, x_a)). Forward kinematics has
several solutions. Numerical continuation finds the one on the assembly mode of the known pose: the joint
variables are fixed, and the geometry changes in stages from one to the other
(:func:`hexacell.kinematics.forward.continue_solution`).

Some commands are not given: those that a controller refused, or the cell file excludes. A command beyond
the limit of an axis says that every command at least as far out along it is refused as well. One that the
cell file excludes may concern all that are near it. Any other refusal concerns that command alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hexacell.kinematics.forward import ForwardResult, continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import AXES, Batch, FrameTransform, Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask

COMMAND_STAGES = (3,)
"""Continuation stages for a command. A pose that needs more is near a singularity and is not used."""

JOINT_TOLERANCE_MM = 1e-6
"""Largest difference between the joint variables of a command and the required ones."""


@dataclass(frozen=True, slots=True)
class RefusedCommand:
    """A command that is not given, in the controller's frames.

    Attributes:
        pose: x, y, z, a, b, c, mm and deg.
        axis: the axis beyond whose limit it is, one of ``xyzabc``; None if another reason was given.
        is_highest: whether that limit is the axis' highest value, not its lowest.
        within_mm, within_deg: commands that are as near as both are concerned as well, unless
            ``within_deg`` is zero.
        may_be_passed: it is refused as a place to measure at alone.
    """

    pose: tuple[float, float, float, float, float, float]
    axis: str | None = None
    is_highest: bool = True
    within_mm: float = 0.0
    within_deg: float = 0.0
    may_be_passed: bool = False

    def concerns(self, poses: PoseBatch) -> Mask:
        """Which of n commands, in the controller's frames, are this one, near it, or as far out."""
        this = PoseBatch.of([Pose(*self.pose)])
        concerned = np.asarray(poses.is_same(this))
        if self.within_deg > 0.0:
            apart = np.linalg.norm(poses.positions - this.positions, axis=-1)
            cosines = 0.5 * (np.einsum("nij,ij->n", poses.rotations, this.rotations[0]) - 1.0)
            angles = np.arccos(np.clip(cosines, -1.0, 1.0))
            concerned |= (apart <= self.within_mm) & (angles <= np.radians(self.within_deg))
        if self.axis is None:
            return concerned
        column, sign = AXES.index(self.axis), 1.0 if self.is_highest else -1.0
        beyond = sign * (poses.numbers()[:, column] - self.pose[column]) >= 0.0
        return np.asarray(concerned | beyond)


@dataclass(frozen=True, slots=True)
class RefusedCommands:
    """All commands that are not given; none at first."""

    commands: tuple[RefusedCommand, ...] = ()

    def __or__(self, others: "RefusedCommands") -> "RefusedCommands":
        """These commands and others, each once."""
        return RefusedCommands(tuple(dict.fromkeys((*self.commands, *others.commands))))

    def allow(
        self, poses: PoseBatch, frames: FrameTransform | None = None, *, to_measure: bool = False
    ) -> Mask:
        """Which of n commands no refusal concerns; ``to_measure``: not only to pass them.

        They are in the controller's frames, or in those that ``frames`` leads to from there.
        """
        allowed = np.ones(len(poses), dtype=bool)
        if not self.commands:
            return allowed
        commands = poses if frames is None else frames.inverse().poses(poses)
        for refused in self.commands:
            if to_measure or not refused.may_be_passed:
                allowed &= ~refused.concerns(commands)
        return allowed

    def allows(self, pose: tuple[float, float, float, float, float, float]) -> bool:
        """Whether no refusal concerns a single command in the controller's frames."""
        return bool(self.allow(PoseBatch.of([Pose(*pose)]))[0])


@dataclass(frozen=True, slots=True, eq=False)
class ActualPoses(Batch):
    """The actual poses of n commands.

    Attributes:
        poses: actual poses; undefined where ``found`` is false.
        joints: joint variables (n, 6), mm, that the controller computes; NaN if out of reach.
        found: (n,) whether controller and robot both reach the pose, on the same assembly mode.
    """

    poses: PoseBatch
    joints: Array
    found: Mask


@dataclass(frozen=True, slots=True, eq=False)
class CommandedRobot:
    """A robot with the geometry ``actual`` under a controller that computes with ``commanding``.

    Both geometries and all poses are in one frame convention.

    Attributes:
        refused: commands that are not given; no joint variables are computed for them.
        frames: from the frames of the commands to the convention's.
    """

    mechanism: Mechanism
    branch: Branch
    commanding: Geometry
    actual: Geometry
    refused: RefusedCommands = field(default_factory=RefusedCommands)
    frames: FrameTransform | None = None

    def joints(self, commands: PoseBatch) -> Array:
        """Joint variables (n, 6) that the controller computes; NaN if out of reach or refused."""
        joints = self.mechanism.inverse(self.commanding, self.branch, commands)
        if self.refused.commands:
            joints[~self.refused.allow(commands, self.frames)] = np.nan
        return joints

    def actual_poses(self, commands: PoseBatch) -> ActualPoses:
        """The actual poses of n commands."""
        joints = self.joints(commands)
        found = np.asarray(np.isfinite(joints).all(axis=-1))
        reachable = found.copy()
        result = continue_solution(
            self.mechanism,
            self.actual,
            joints[reachable],
            start=commands[reachable],
            start_geometry=self.commanding,
        )
        found[reachable] = result.found
        return ActualPoses(commands.with_rows(reachable, result.poses), joints, found)

    def commands_for(
        self, poses: PoseBatch, joints: Array, *, stages: Sequence[int] = COMMAND_STAGES
    ) -> ForwardResult:
        """The commands (n) that bring the robot to n actual poses with these joint variables (n, 6).

        One is not found if the controller's geometry has no pose at these joint variables, or has one only
        on another assembly mode or branch.
        """
        result = continue_solution(
            self.mechanism,
            self.commanding,
            joints,
            start=poses,
            start_geometry=self.actual,
            stage_counts=stages,
        )
        agrees = np.abs(self.joints(result.poses) - joints) < JOINT_TOLERANCE_MM  # not where it is NaN
        return ForwardResult(result.poses, result.found & agrees.all(axis=-1))
