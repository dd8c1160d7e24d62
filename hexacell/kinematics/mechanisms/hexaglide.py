"""The 6-PUS Hexaglide: six sliders on parallel rails, six fixed legs, one platform.

Leg i closes when ``|S_i + q_i e - P - R B_i| = l_i``, with e the rails' direction (base x). The
constraint used is ``(|v_i|^2 - l_i^2) / (2 l_i)``: polynomial, and near zero the leg's error in mm.
Source: Abtahi et al. 2010, eq. 4 and 14, and the leg equation in ``docs/method.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.legs import CLOSEST_JOINTS_MM, Legs, axes_through, by_pose, mean_radius
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

HEXAGLIDE_PARAMETERS = ParameterSet(
    (
        ParameterKind(
            "S",
            ("x", "y", "z"),
            meaning="spherical joints in the base frame at q = 0, mm, legs 1 to 6",
            tolerance_meaning="every coordinate of a spherical joint",
            part=MachinePart.BASE,
            default_tolerance=7.0,
        ),
        ParameterKind(
            "B",
            ("x", "y", "z"),
            meaning="universal joints in the platform frame (origin: the ball), mm",
            tolerance_meaning="every coordinate of a universal joint",
            part=MachinePart.PLATFORM,
            default_tolerance=7.0,
            has_ball_offset=True,
        ),
        ParameterKind(
            "l",
            (),
            meaning="leg lengths, mm",
            tolerance_meaning="every leg length",
            part=MachinePart.LEGS,
            default_tolerance=7.0,
            display="leg {leg} length",
            is_positive=True,
        ),
    )
)

PAPER_FRAME = FrameConvention(
    name="paper",
    parameters=HEXAGLIDE_PARAMETERS,
    zero=("S2x", "S2y", "S2z", "S3z"),
    equal=(("B2z", "B3z", "B5z"), ("B2y", "B5y")),
)


RAILS = ((0, 5), (1, 4), (2, 3))
"""Legs, counted from 0, whose sliders share a rail: their joints are at the same height and side."""


class Hexaglide:
    """The Hexaglide as a :class:`~hexacell.kinematics.mechanism.Mechanism`; stateless."""

    name = "hexaglide"
    words = MechanismWords("Hexaglide", joint="slider", guide="rail")
    parameters = HEXAGLIDE_PARAMETERS
    convention = PAPER_FRAME
    frame_freedom = FrameFreedom(base="x")  # the rails run along base x

    def residual_and_jacobian(
        self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        """Length errors of the legs (n, 6), mm, and their derivatives by the pose (n, 6, 6)."""
        b, v = _leg_vectors(geometry, poses, joints)
        lengths = geometry["l"]
        errors = (np.einsum("nij,nij->ni", v, v) - lengths**2) / (2.0 * lengths)
        return errors, by_pose(b, -v / lengths[..., None])

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        """Derivatives of the legs' length errors by pose, joint variables and parameters."""
        b, v = _leg_vectors(geometry, poses, joints)
        n = v / geometry["l"][:, None]
        by_length = -0.5 * (np.sum(n * n, axis=-1, keepdims=True) + 1.0)
        return ConstraintDerivatives(
            pose=by_pose(b, -n),
            joints=n[..., 0],
            parameters=np.concatenate([n, -n @ poses.rotations, by_length], axis=-1),
        )

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses; NaN out of reach."""
        v = geometry["S"] - poses.positions[:, None, :] - _to_platform(geometry, poses)
        along_rail_squared = geometry["l"] ** 2 - v[..., 1] ** 2 - v[..., 2] ** 2
        reachable = along_rail_squared >= 0.0
        along_rail = np.sqrt(np.where(reachable, along_rail_squared, np.nan))
        return np.asarray(branch) * along_rail - v[..., 0]

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """The inverse solution, -1 or 1, that each leg is on (n, 6)."""
        _, v = _leg_vectors(geometry, poses, joints)
        return np.where(v[..., 0] < 0.0, -1, 1)

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        """Origin at S2, S3 at the same height, platform axes through B2, B5 and B3."""
        S, B = geometry["S"], geometry["B"]
        base = _leveling_roll(S[2] - S[1])
        platform = axes_through(B[1], B[4], B[2], "platform")
        change = FrameTransform(base, S[1].copy(), platform)
        S = (S - S[1]) @ base.T
        B = B @ platform.T
        # Later code relies on the rules being exact; the rotations satisfy them only to rounding.
        S[1], S[2, 2] = 0.0, 0.0
        B[[2, 4], 2] = B[1, 2]
        B[4, 1] = B[1, 1]
        return hexaglide_geometry(S, B, geometry["l"]), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        """The geometry of the machine in other frames."""
        S = (geometry["S"] - change.origin) @ change.base.T
        return hexaglide_geometry(S, geometry["B"] @ change.platform.T, geometry["l"])

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """Changes (P, 6) of the parameters by the encoders' zeros: the joints on the sliders, along x."""
        moved = np.zeros((6, 3, 6))
        moved[np.arange(6), 0, np.arange(6)] = 1.0
        return self.parameters.changes("S", moved)

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        """The guides of the sliders at n poses."""
        _, v = _leg_vectors(geometry, poses, joints)
        n = v / geometry["l"][:, None]
        return Guides(RAILS, along=geometry["S"][:, 0] + joints, across=n[..., 1:])

    def legs(self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array) -> Legs:
        """The legs in space at n poses."""
        at_platform = poses.positions[:, None, :] + _to_platform(geometry, poses)
        return Legs(_at_sliders(geometry, joints), at_platform, poses.rotations)

    def platform_radius(self, geometry: Geometry | GeometryBatch) -> Array:
        """Mean distance of the platform joints from the ball, mm."""
        return mean_radius(geometry, "B")


def hexaglide_geometry(S: ArrayLike, B: ArrayLike, l: ArrayLike) -> Geometry:  # noqa: E741
    """The geometry of slider joints S (6, 3), platform joints B (6, 3) and leg lengths l (6,), mm."""
    return Geometry.of(HEXAGLIDE_PARAMETERS, {"S": S, "B": B, "l": l})


def _at_sliders(geometry: Geometry | GeometryBatch, joints: Array) -> Array:
    """S_i + q_i e (n, 6, 3), mm."""
    at_sliders = np.empty((*joints.shape, 3))
    at_sliders[:] = geometry["S"]
    at_sliders[..., 0] += joints
    return at_sliders


def _to_platform(geometry: Geometry | GeometryBatch, poses: PoseBatch) -> Array:
    """R B_i (n, 6, 3), mm."""
    # Products of small matrices are twice as fast in one layout.
    b: Array = geometry["B"] @ np.ascontiguousarray(np.swapaxes(poses.rotations, -1, -2))
    return b


def _leg_vectors(
    geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
) -> tuple[Array, Array]:
    """R B_i (n, 6, 3), and v_i (n, 6, 3) from platform joint to slider joint, mm."""
    b = _to_platform(geometry, poses)
    v = geometry["S"] - poses.positions[:, None, :] - b
    v[..., 0] += joints
    return b, v


def _leveling_roll(vector: Array) -> Array:
    """The rotation about x that turns ``vector`` into z = 0, y > 0."""
    across = np.hypot(vector[1], vector[2])
    if across < CLOSEST_JOINTS_MM:
        raise UsageError("two slider joints that fix the frame are on one rail")
    y, z = vector[1:] / across
    return np.array([[1.0, 0.0, 0.0], [0.0, y, z], [0.0, -z, y]])
