"""Sensitivity of a pose to the free parameters: what estimates and choices of poses are made of; batched.

A free parameter stands for one parameter of a leg, or for several that a frame convention makes equal. Its
derivative is the sum of theirs: most are one number of one leg, so that they are picked and few are added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.compiled.availability import is_compiled, own
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import ConstraintDerivatives, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import inverse_and_mode

POSITION = 3
POSE = 6
"""How many of a pose's coordinates are wanted: the ball's position, or all."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeSensitivity:
    """Derivatives of a pose by the joint variables (n, m, 6) and the free parameters (n, m, p).

    Rows are the ball's position, mm, then, if m is 6, the rotation vector in the base frame, rad. ``mode``
    (n,) is the assembly mode.
    """

    joints: Array
    free: Array
    mode: Array

    def __getitem__(self, rows: NDArray[np.intp]) -> FreeSensitivity:
        return FreeSensitivity(self.joints[rows], self.free[rows], self.mode[rows])


def free_sensitivity(
    mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array, coordinates: int = POSE
) -> FreeSensitivity:
    """Implicit derivatives at n poses that close the mechanism; see :mod:`.sensitivity`.

    Raises:
        LinAlgError: a pose is exactly at a singularity.
    """
    linear = mechanism.derivatives(geometry, poses, joints)
    if is_compiled() and (found := _compiled(mechanism, linear, coordinates)):
        return found
    inverse, mode = inverse_and_mode(linear.pose)
    by_constraints = -inverse[:, :coordinates]
    by_joints = by_constraints * linear.joints[..., None, :]
    return FreeSensitivity(by_joints, _by_free(mechanism, by_constraints, linear), mode)


def _by_free(mechanism: Mechanism, by_constraints: Array, linear: ConstraintDerivatives) -> Array:
    """Derivatives (n, m, p) by the free parameters, from those by the constraints (n, m, 6)."""
    products = by_constraints[..., None] * linear.parameters[..., None, :, :]
    of_legs = products.reshape(*by_constraints.shape[:2], len(mechanism.parameters))
    order, convention = mechanism.parameters.leg_order, mechanism.convention
    by_free: Array = np.take(of_legs, order[convention.free_rows()], axis=-1)
    for row, column in convention.dependent:
        by_free[..., column] += of_legs[..., order[row]]
    return by_free


def _compiled(
    mechanism: Mechanism, linear: ConstraintDerivatives, coordinates: int
) -> FreeSensitivity | None:
    """The same, compiled; none where a pose is exactly at a singularity."""
    # Only where numba is installed.
    from hexacell.kinematics.compiled.sensitivities import by_joints_and_free  # noqa: PLC0415

    count, size = len(linear.joints), len(mechanism.convention.free_rows())
    by_joints, by_free = np.empty((count, coordinates, 6)), np.zeros((count, coordinates, size))
    determinants = np.empty(count)
    numbers = own(linear.pose), own(linear.joints), own(linear.parameters)
    by_joints_and_free(*numbers, mechanism.convention.leg_columns, by_joints, by_free, determinants)
    return FreeSensitivity(by_joints, by_free, np.sign(determinants)) if determinants.all() else None
