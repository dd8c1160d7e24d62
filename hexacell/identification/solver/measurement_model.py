"""What a geometry predicts for every record, how that changes, and how far to trust it."""

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
    """A geometry seen through the records.

    Attributes:
        free: free parameters (p,), mm.
        poses: the platform's poses at the measured joint variables.
        residuals: (n, 3), mm: predicted position less measured deviation, each point's unknown
            constant still in it.
        weights: (n, 3, 3), 1/mm^2: inverse covariance of one record.
        pose_jacobian: (n, 6, p) of position, mm, and rotation vector, rad, by the free parameters.
        mode: (n,) the assembly mode, see :func:`hexacell.kinematics.sensitivity.assembly_mode`.
        amplification: (n,) mm of ball a mm of slider: large next to a singularity.
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
    """The residuals of a geometry to be tried.

    Attributes:
        poses: n poses that close it.
        residuals: (n, 3), mm, as in :class:`Prediction`.
        found: (n,) bool: which poses were found on their assembly mode.
    """

    poses: PoseBatch
    residuals: Array
    found: Mask


def evaluate_step(problem: Problem, now: Prediction, step: Array) -> TrialStep:
    """The residuals after a step (p,), mm, of the free parameters.

    Poses start where the linearisation puts them; where that is too far, at the present ones.
    """
    geometry = problem.mechanism.convention.geometry(now.free + step)
    for start in (apply_twist(now.poses, now.pose_jacobian @ step), now.poses):
        result = forward_kinematics(problem.mechanism, geometry, problem.joints, start, mode=now.mode)
        if result.found.all():
            break
    return TrialStep(result.poses, result.poses.positions - problem.deviations, result.found)


def predict(problem: Problem, free: Array, poses: PoseBatch) -> Prediction:
    """Everything a solver step needs, at poses that close the geometry."""
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
    """Covariance (n, 3, 3), mm^2, of records: encoder noise through the machine, and the gauges'.

    Near a singularity the first part is large, and ordinary least squares pays for ignoring it.
    """
    through_machine = position_by_joints @ np.swapaxes(position_by_joints, -1, -2)
    return noise.encoder_mm**2 * through_machine + noise.gauge_mm**2 * np.eye(3)


def record_weights(position_by_joints: Array, noise: Noise) -> Array:
    """Inverse of :func:`record_covariance`."""
    return np.linalg.inv(record_covariance(position_by_joints, noise))
