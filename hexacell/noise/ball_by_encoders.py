"""How the ball moves by what the encoders show, near one pose, and how well that is known.

At the same commanded pose a machine that does not repeat stops elsewhere each time. The encoders show where
its joints are, and so where the ball is: ``G dq``, with ``G = dP/dq``. The geometry is not known exactly,
and G changes with it. By parameters p with the covariance C the motion is known with the covariance

    (dG/dp dq) C (dG/dp dq)^T,

and what the encoders show with that of their noise. A difference of the gauges that is larger has another
cause than where the joints are.
"""

from dataclasses import dataclass

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.forward import apply_twist, forward_kinematics
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import POSITION, free_sensitivity
from hexacell.robot.model import Robot
from hexacell.uncertainty.statement import covariance_factor

STEP_MM = 0.1
"""Length by which the ball is moved for the derivative of its sensitivities."""


@dataclass(frozen=True, slots=True, eq=False)
class BallByEncoders:
    """The motion of the ball along base x, y, z by small changes of the joint variables.

    Attributes:
        by_joints: derivative G (3, 6), mm by the unit of the joint variables.
        unknown: (3, p, 6) changes of G by one standard deviation of what is not known of the geometry.
    """

    by_joints: Array
    unknown: Array

    @classmethod
    def at(
        cls, robot: Robot, belief: RobotBelief, command: PoseBatch, shown: Array | None = None
    ) -> "BallByEncoders":
        """Near a command (1) of a robot, in the frame convention; where its encoders show (6,) there.

        Another geometry may have commanded it. Zero is no reading.

        Raises:
            LinAlgError: the pose is exactly at a singularity.
        """
        mechanism, geometry = belief.mechanism, belief.estimate
        actual = belief.commanded.actual_poses(command)
        if actual.found[0]:
            poses, joints = actual.poses, actual.joints
        else:  # the robot as drawn cannot be there, and yet it is: nearly at the command
            poses = command
            joints = mechanism.inverse(belief.controller, belief.branch, command)
        if shown is not None and shown.any():
            solved = forward_kinematics(mechanism, geometry, shown[None], poses)
            if solved.found[0]:
                poses, joints = solved.poses, shown[None]
        whole = free_sensitivity(mechanism, geometry, poses, joints).joints[0]
        steps = STEP_MM / np.linalg.norm(whole[:3], axis=0)
        moved = np.concatenate([np.diag(steps), -np.diag(steps)])
        near = apply_twist(poses[np.zeros(len(moved), dtype=int)], moved @ whole.T)
        by_free = free_sensitivity(mechanism, geometry, near, joints + moved, POSITION).free
        ahead, behind = np.split(by_free, 2)
        changes, to_base = (ahead - behind) / (2.0 * steps[:, None, None]), robot.frames.base.T
        unknown = np.einsum("ab,jbp,pk->akj", to_base, changes, covariance_factor(belief.covariance))
        return cls(to_base @ whole[:3], np.asarray(unknown))

    def motion(self, joints: Array) -> Array:
        """How far the ball moves (..., 3), mm, as the joint variables change by (..., 6)."""
        return np.asarray(joints @ self.by_joints.T)

    def covariance(self, joints: Array) -> Array:
        """What is not known of that motion (..., 3, 3), mm^2, because the geometry is not."""
        columns = np.einsum("apj,...j->...ap", self.unknown, joints)
        return np.asarray(columns @ np.swapaxes(columns, -1, -2))
