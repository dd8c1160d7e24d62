"""Fewer than six driven legs: passive joints hold directions of the platform square to some of the base.

With an axis i of the base frame, an axis j of the platform frame and an angle s by which they are not
square, a passive constraint is

    L (e_i . R e_j - sin s) = 0,

in mm at a distance L. Its derivative by a small turn of the platform is ``L (R e_j) x e_i``; where the ball
is does not matter. Frames may be turned about these axes only; else the constraint is not of that form.

A pose is completed by Newton's method on the angles a, b, c that the robot does not have; the others and
the ball's position are as they are.

Source: Merlet, Parallel Robots, 2nd ed. 2006 (robots with fewer than six freedoms).
"""

import numpy as np

from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.mechanism import Branch, ConstraintDerivatives
from hexacell.kinematics.mechanisms.jointed_legs import JointedLegs
from hexacell.kinematics.pose import AXES, PoseBatch
from hexacell.kinematics.rotations import Array

LEVER_MM = 100.0
"""At this distance an angle counts as a length."""

MOST_STEPS = 20
CLOSED_MM = 1e-12 * LEVER_MM


class HeldDirections(JointedLegs):
    """Driven legs, and beside them one passive constraint for each freedom that is missing.

    ``held`` are the axes of base and platform, counted from 0, that are held square; ``skew`` is the symbol
    of the angles that they are off, if that is a parameter, one for each of them.
    """

    held: tuple[tuple[int, int], ...]
    skew: str | None = None

    def residual_and_jacobian(
        self, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        of_legs, by_pose = super().residual_and_jacobian(geometry, poses, joints)
        errors, by_turn = self._held(geometry, poses)
        return np.concatenate([of_legs, errors], axis=-1), _with_rows(by_pose, by_turn)

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        of_legs = super().derivatives(geometry, poses, joints)
        _, by_turn = self._held(geometry, poses)
        by_parameters = np.zeros((len(poses), len(self.held), of_legs.parameters.shape[-1]))
        if self.skew is not None:
            by_parameters[..., 0] = -LEVER_MM * np.cos(geometry[self.skew])
        parameters = np.concatenate([of_legs.parameters, by_parameters], axis=1)
        return ConstraintDerivatives(_with_rows(of_legs.pose, by_turn), of_legs.joints, parameters)

    def completed(self, geometry: Geometry, poses: PoseBatch) -> PoseBatch:
        columns = [axis for axis, letter in enumerate(AXES[3:]) if letter not in self.coordinates]
        errors, by_turn = self._held(geometry, poses)
        rows = np.flatnonzero(np.abs(errors).max(axis=-1, initial=0.0) >= CLOSED_MM)
        if not len(rows):
            return poses
        turned, errors, by_turn = poses[rows], errors[rows], by_turn[rows]
        angles = np.array(rotations.to_angles(turned.rotations))
        # Not from where a candidate for another robot is: that may be nearer to the opposite solution.
        angles[..., columns] = np.pi * np.round(angles[..., columns] / np.pi)
        turned = PoseBatch(turned.positions, rotations.from_angles(angles))
        errors, by_turn = self._held(geometry, turned)
        for _ in range(MOST_STEPS):
            by_angles = by_turn @ _axes_of_angles(angles)[..., columns]
            angles[..., columns] -= np.linalg.solve(by_angles, errors[..., None])[..., 0]
            turned = PoseBatch(turned.positions, rotations.from_angles(angles))
            errors, by_turn = self._held(geometry, turned)
            if np.abs(errors).max() < CLOSED_MM:
                break
        return poses.with_rows(rows, turned)

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Of the completed poses."""
        return super().inverse(geometry, branch, self.completed(geometry, poses))  # type: ignore[safe-super]

    def _held(self, geometry: Geometries, poses: PoseBatch) -> tuple[Array, Array]:
        """Errors (n, k), mm, of the passive constraints and their derivatives (n, k, 3) by a turn, rad."""
        base, platform = np.array(self.held).T
        held = np.moveaxis(poses.rotations[..., platform], -1, -2)
        sines = 0.0 if self.skew is None else np.sin(geometry[self.skew])
        errors = np.take_along_axis(held, base[None, :, None], axis=-1)[..., 0] - sines
        return LEVER_MM * errors, LEVER_MM * np.cross(held, np.eye(3)[base])


def _with_rows(by_pose: Array, by_turn: Array) -> Array:
    """Derivatives (n, J, 6) with those (n, k, 3) by a turn below them."""
    return np.concatenate([by_pose, np.concatenate([np.zeros_like(by_turn), by_turn], axis=-1)], axis=1)


def _axes_of_angles(angles: Array) -> Array:
    """The axes (n, 3, 3), in columns, about which a, b and c turn the platform."""
    a_zero, only_c = angles.copy(), np.zeros_like(angles)
    a_zero[..., 0], only_c[..., 2] = 0.0, angles[..., 2]
    x, y = rotations.from_angles(a_zero)[..., 0], rotations.from_angles(only_c)[..., 1]
    return np.stack([x, y, np.broadcast_to([0.0, 0.0, 1.0], x.shape)], axis=-1)
