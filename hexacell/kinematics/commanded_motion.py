"""Where a robot goes when its controller computes with another geometry.

The controller solves the inverse kinematics of its own geometry G_c for a commanded pose x_c and moves
the joints to q = IK(G_c, x_c). The platform of a robot with the geometry G_a then takes the pose

    x_a = FK(G_a, q),

and the command that brings the robot to a pose x_a is x_c = FK(G_c, IK(G_a, x_a)). Forward kinematics has
several solutions. The one on the assembly mode of the known pose is found by numerical continuation: the
joint variables stay, and the geometry changes in stages from one to the other
(:func:`hexacell.kinematics.forward.continue_solution`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.forward import CONTINUATION_STAGES, ForwardResult, continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

COMMAND_STAGES = (3,)
"""Continuation stages towards a command. A pose that needs more is next to a singularity, and left out."""

JOINT_TOLERANCE_MM = 1e-6
"""How exactly a command's inverse kinematics must give the joint variables back."""


def change_geometry(
    mechanism: Mechanism,
    before: Geometry,
    after: Geometry,
    poses: PoseBatch,
    joints: Array,
    *,
    stages: Sequence[int] = CONTINUATION_STAGES,
) -> ForwardResult:
    """Poses of another geometry at the same joint variables (n, 6), mm.

    ``poses`` (n) close the geometry ``before`` at these joint variables; the result closes ``after``.
    """
    return continue_solution(
        mechanism,
        after,
        joints,
        start=poses,
        start_geometry=before,
        start_joints=joints,
        tries=stages,
    )


@dataclass(frozen=True, slots=True, eq=False)
class ActualPoses:
    """Where n commands take a robot.

    Attributes:
        poses: actual poses; where ``found`` is false they mean nothing.
        joints: joint variables (n, 6), mm, that the controller computes; NaN where it cannot reach.
        found: (n,) whether controller and robot can take the pose, on the same assembly mode.
    """

    poses: PoseBatch
    joints: Array
    found: Mask


@dataclass(frozen=True, slots=True, eq=False)
class CommandedRobot:
    """A robot with the geometry ``actual`` under a controller that computes with ``commanding``.

    Both geometries and all poses are in one frame convention.
    """

    mechanism: Mechanism
    branch: Branch
    commanding: Geometry
    actual: Geometry

    def joints(self, commands: PoseBatch) -> Array:
        """Joint variables (n, 6), mm, that the controller computes; NaN where it cannot reach."""
        return self.mechanism.inverse(self.commanding, self.branch, commands)

    def actual_poses(self, commands: PoseBatch) -> ActualPoses:
        """Where n commands take the robot."""
        joints = self.joints(commands)
        reachable = np.asarray(np.isfinite(joints).all(axis=-1))
        if reachable.all():
            result = self._actual(commands, joints)
            return ActualPoses(result.poses, joints, result.found)
        result = self._actual(commands[reachable], joints[reachable])
        found = reachable.copy()
        found[reachable] = result.found
        return ActualPoses(commands.with_rows(reachable, result.poses), joints, found)

    def commands_for(
        self, poses: PoseBatch, joints: Array, *, stages: Sequence[int] = COMMAND_STAGES
    ) -> ForwardResult:
        """Commands (n) that bring the robot to actual poses, which it takes at ``joints`` (n, 6), mm.

        Not found where the controller's geometry cannot take these joint variables, or only on another
        assembly mode or branch.
        """
        result = change_geometry(self.mechanism, self.actual, self.commanding, poses, joints, stages=stages)
        error = np.abs(np.nan_to_num(self.joints(result.poses), nan=np.inf) - joints)
        agrees = error.max(axis=-1, initial=0.0) < JOINT_TOLERANCE_MM
        return ForwardResult(result.poses, result.found & agrees)

    def _actual(self, commands: PoseBatch, joints: Array) -> ForwardResult:
        return change_geometry(self.mechanism, self.commanding, self.actual, commands, joints)
