"""A Gough-Stewart platform: a second mechanism, which the product does not know.

Leg i closes when ``|P + R B_i - A_i| = z_i + q_i``. The kinds of its parameters have other names, another
order and another frame convention than those of the Hexaglide.
"""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import (
    Branch,
    ConstraintDerivatives,
    FrameConvention,
    FrameFreedom,
    FrameTransform,
    Guides,
    MechanismWords,
)
from hexacell.kinematics.parameters import MachinePart, ParameterKind, ParameterSet
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

PARAMETERS = ParameterSet(
    (
        ParameterKind(
            "z",
            (),
            "leg lengths at q = 0, mm",
            "every leg length",
            "leg {leg} zero",
            is_positive=True,
            default_tolerance=1.0,
            part=MachinePart.LEGS,
        ),
        ParameterKind(
            "A",
            ("x", "y", "z"),
            "joints on the base, mm",
            "every joint on the base",
            default_tolerance=2.0,
            part=MachinePart.BASE,
        ),
        ParameterKind(
            "B",
            ("x", "y", "z"),
            "joints on the platform, mm",
            "every joint",
            has_ball_offset=True,
            default_tolerance=2.0,
            part=MachinePart.PLATFORM,
        ),
    )
)
CONVENTION = FrameConvention(
    name="first three joints",
    parameters=PARAMETERS,
    zero=("A1x", "A1y", "A1z", "A2y", "A2z", "A3z"),
    equal=(("B1z", "B2z", "B3z"), ("B1y", "B2y")),
)


class GoughStewart:
    """Six legs of variable length between two plates."""

    name = "gough-stewart"
    words = MechanismWords("hexapod", joint="leg")
    parameters = PARAMETERS
    convention = CONVENTION
    frame_freedom = FrameFreedom()

    def residual_and_jacobian(
        self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        b, v = _vectors(geometry, poses)
        length = geometry["z"] + joints
        return _errors(v, length), _by_pose(b, v / length[..., None])

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        b, v = _vectors(geometry, poses)
        length = geometry["z"] + joints
        n = v / length[..., None]
        by_length = -0.5 * (np.sum(n * n, axis=-1) + 1.0)
        return ConstraintDerivatives(
            pose=_by_pose(b, n),
            joints=by_length,
            parameters=np.concatenate([by_length[..., None], -n, n @ poses.rotations], axis=-1),
        )

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        lengths: Array = np.linalg.norm(_vectors(geometry, poses)[1], axis=-1)
        return lengths - geometry["z"]

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        return np.ones_like(joints)

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        A, B = geometry["A"], geometry["B"]
        change = FrameTransform(_axes(*A[:3]), A[0].copy(), _axes(*B[:3]))
        moved = self.change_frames(geometry, change)
        free = CONVENTION.free_parameters(moved)
        return CONVENTION.geometry(free), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        A, B = (geometry["A"] - change.origin) @ change.base.T, geometry["B"] @ change.platform.T
        return Geometry.of(PARAMETERS, {"z": geometry["z"], "A": A, "B": B})

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        return None

    def legs(self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array) -> Legs:
        b, v = _vectors(geometry, poses)
        at_platform = poses.positions[:, None, :] + b
        return Legs(at_platform - v, at_platform, poses.rotations)

    def platform_radius(self, geometry: Geometry | GeometryBatch) -> Array:
        radius: Array = np.mean(np.linalg.norm(geometry["B"], axis=-1), axis=-1)
        return radius


def _vectors(geometry: Geometry | GeometryBatch, poses: PoseBatch) -> tuple[Array, Array]:
    b = geometry["B"] @ np.swapaxes(poses.rotations, -1, -2)
    return b, poses.positions[:, None, :] + b - geometry["A"]


def _errors(v: Array, length: Array) -> Array:
    error: Array = (np.sum(v * v, axis=-1) - length**2) / (2.0 * length)
    return error


def _by_pose(b: Array, n: Array) -> Array:
    return np.concatenate([n, np.cross(b, n)], axis=-1)


def _axes(first: Array, second: Array, third: Array) -> Array:
    """Rows: x from the first joint to the second, z normal to the plane of all three."""
    x = (second - first) / np.linalg.norm(second - first)
    z = np.cross(x, third - first)
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])
