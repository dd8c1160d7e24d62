"""The measurement model: residuals of every record, their derivatives and their weights.

A record predicts the ball's position P(p, q) by forward kinematics at the measured joint variables q
(Abtahi et al. 2010, eq. 4). Its residual is P minus the measured deviation; the unknown constant of each
point, which the differences of eq. 5 remove, stays in it. The noise of the encoders reaches the residual
through ``G = dP/dq``, so that, to first order, a record's covariance is

    V = G diag(s_encoder^2) G^T + diag(s_gauge^2).

Near a singularity the first term is large, and ordinary least squares (eq. 13) would weight such a record
wrongly. The weight is the inverse of V (generalized least squares; Aitken 1936).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Noise, Problem
from hexacell.kinematics.forward import ForwardResult, apply_twist, forward_kinematics
from hexacell.kinematics.free_sensitivity import free_sensitivity
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

LARGEST_AMPLIFICATION = 100.0
"""mm of the ball per mm of a slider. Beyond it a record has no information and its linearization fails."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The measurement model at one geometry, linearized.

    Attributes:
        free: free parameters (p,), mm.
        poses: the platform's poses at the measured joint variables.
        residuals: (n, 3), mm: predicted position minus measured deviation, with each point's unknown
            constant.
        weights: (n, 3, 3), 1/mm^2: inverse covariance of one record.
        pose_jacobian: (n, 6, p) of position, mm, and rotation vector, rad, by the free parameters.
        by_joints: (n, 3, 6) of the ball's position by the joint variables.
        mode: (n,) the assembly mode, see :func:`hexacell.kinematics.sensitivity.assembly_mode`.
        singular: (n,) whether a record is next to a singularity.
    """

    free: Array
    poses: PoseBatch
    residuals: Array
    weights: Array
    pose_jacobian: Array
    by_joints: Array
    mode: Array
    singular: Mask

    @property
    def jacobian(self) -> Array:
        """(n, 3, p) of the residuals by the free parameters."""
        return self.pose_jacobian[:, :3]


def evaluate_step(problem: Problem, present: Prediction, step: Array) -> ForwardResult:
    """The poses after a step (p,), mm, of the free parameters.

    Forward kinematics starts at the linearized poses. If that fails, it starts at the present ones.
    """
    geometry = problem.geometry(present.free + step)
    for start in (apply_twist(present.poses, present.pose_jacobian @ step), present.poses):
        result = forward_kinematics(problem.mechanism, geometry, problem.joints, start, mode=present.mode)
        if result.found.all():
            break
    return result


def predict(problem: Problem, free: Array, poses: PoseBatch) -> Prediction:
    """The linearized measurement model at poses that close the geometry."""
    sensitivity = free_sensitivity(problem.mechanism, problem.geometry(free), poses, problem.joints)
    by_joints = sensitivity.joints[:, :3]
    return Prediction(
        free=free,
        poses=poses,
        residuals=poses.positions - problem.deviations,
        weights=record_weights(by_joints, problem.noise),
        pose_jacobian=sensitivity.free,
        by_joints=by_joints,
        mode=sensitivity.mode,
        singular=is_singular(by_joints),
    )


def is_singular(position_by_joints: Array) -> Mask:
    """Whether each record is next to a singularity, by ``dP/dq`` (n, 3, 6)."""
    singular: Mask = np.linalg.norm(position_by_joints, axis=(-2, -1)) > LARGEST_AMPLIFICATION
    return singular


def record_covariance(position_by_joints: Array, noise: Noise) -> Array:
    """Covariance (n, 3, 3), mm^2, of records by ``dP/dq`` (n, 3, 6), from encoder and gauge noise."""
    covariance: Array = noise.encoder_covariance(position_by_joints) + noise.gauge_covariance
    return covariance


def record_weights(position_by_joints: Array, noise: Noise) -> Array:
    """Inverse of :func:`record_covariance`."""
    return np.linalg.inv(record_covariance(position_by_joints, noise))
