"""The measurement model: residuals of every record, their derivatives and their weights.

A record predicts the ball's position P(p, q) by forward kinematics at the measured joint variables q. Its
residual is P minus the measured deviation; the unknown constant of each point stays in it. The noise of
the encoders reaches the residual through ``G = dP/dq``, so that a record's covariance is

    V = s_encoder^2 G G^T + s_gauge^2 I.

Near a singularity the first term is large, and ordinary least squares would weight such a record
wrongly. The weight is the inverse of V.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Noise, Problem
from hexacell.kinematics.forward import apply_twist, forward_kinematics
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import pose_sensitivity


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The measurement model at one geometry, linearised.

    Attributes:
        free: free parameters (p,), mm.
        poses: the platform's poses at the measured joint variables.
        residuals: (n, 3), mm: predicted position minus measured deviation, with each point's unknown
            constant.
        weights: (n, 3, 3), 1/mm^2: inverse covariance of one record.
        pose_jacobian: (n, 6, p) of position, mm, and rotation vector, rad, by the free parameters.
        mode: (n,) the assembly mode, see :func:`hexacell.kinematics.sensitivity.assembly_mode`.
        amplification: (n,) ball motion per slider motion, Frobenius norm; large near a singularity.
    """

    free: Array
    poses: PoseBatch
    residuals: Array
    weights: Array
    pose_jacobian: Array
    mode: Array
    amplification: Array

    @property
    def jacobian(self) -> Array:
        """(n, 3, p) of the residuals by the free parameters."""
        return self.pose_jacobian[:, :3]


@dataclass(frozen=True, slots=True, eq=False)
class TrialStep:
    """The residuals after a trial step.

    Attributes:
        poses: n poses that close the geometry.
        residuals: (n, 3), mm, as in :class:`Prediction`.
        found: (n,) bool: whether the pose was found on its assembly mode.
    """

    poses: PoseBatch
    residuals: Array
    found: Mask


def evaluate_step(problem: Problem, present: Prediction, step: Array) -> TrialStep:
    """The residuals after a step (p,), mm, of the free parameters.

    Forward kinematics starts at the linearised poses. If that fails, it starts at the present ones.
    """
    geometry = problem.mechanism.convention.geometry(present.free + step)
    for start in (apply_twist(present.poses, present.pose_jacobian @ step), present.poses):
        result = forward_kinematics(problem.mechanism, geometry, problem.joints, start, mode=present.mode)
        if result.found.all():
            break
    return TrialStep(result.poses, result.poses.positions - problem.deviations, result.found)


def predict(problem: Problem, free: Array, poses: PoseBatch) -> Prediction:
    """The linearised measurement model at poses that close the geometry."""
    geometry = problem.mechanism.convention.geometry(free)
    sensitivity = pose_sensitivity(problem.mechanism, geometry, poses, problem.joints)
    by_joints = sensitivity.joints[:, :3]
    return Prediction(
        free=free,
        poses=poses,
        residuals=poses.positions - problem.deviations,
        weights=record_weights(by_joints, problem.noise),
        pose_jacobian=sensitivity.parameters @ problem.basis,
        mode=sensitivity.mode,
        amplification=np.linalg.norm(by_joints, axis=(-2, -1)),
    )


def record_covariance(position_by_joints: Array, noise: Noise) -> Array:
    """Covariance (n, 3, 3), mm^2, of records by ``dP/dq`` (n, 3, 6), from encoder and gauge noise."""
    propagated = position_by_joints @ np.swapaxes(position_by_joints, -1, -2)
    return noise.encoder_mm**2 * propagated + noise.gauge_mm**2 * np.eye(3)


def record_weights(position_by_joints: Array, noise: Noise) -> Array:
    """Inverse of :func:`record_covariance`."""
    return np.linalg.inv(record_covariance(position_by_joints, noise))
