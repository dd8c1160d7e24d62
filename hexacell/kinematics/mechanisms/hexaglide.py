"""The 6-PUS Hexaglide: six sliders on parallel rails, six fixed legs, one platform.

Leg i closes when ``|S_i + q_i e - P - R B_i| = l_i``, with e the rails' direction (base x). The
constraint used is ``(|v_i|^2 - l_i^2) / (2 l_i)``: polynomial, and near zero the leg's error in mm.
Source: Abtahi et al. 2010, eq. 4 and 14, and the leg equation in ``docs/method.md``.
"""

import numpy as np

from hexacell.errors import UsageError
from hexacell.kinematics import mechanism
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import CLOSEST_JOINTS_MM, axes_through, by_pose
from hexacell.kinematics.mechanisms.jointed_legs import JointedLegs
from hexacell.kinematics.parameters import MachinePart, ParameterKind, ParameterSet
from hexacell.kinematics.pose import FrameTransform, PoseBatch
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

PAPER_FRAME = mechanism.FrameConvention(
    name="paper",
    parameters=HEXAGLIDE_PARAMETERS,
    zero=("S2x", "S2y", "S2z", "S3z"),
    equal=(("B2z", "B3z", "B5z"), ("B2y", "B5y")),
)


RAILS = ((0, 5), (1, 4), (2, 3))
"""Legs, counted from 0, whose sliders share a rail: their joints are at the same height and side."""


class Hexaglide(JointedLegs):
    """The Hexaglide, with constraints of its own that are polynomials."""

    name = "hexaglide"
    words = mechanism.MechanismWords("Hexaglide", joint="slider", guide="rail")
    parameters = HEXAGLIDE_PARAMETERS
    convention = PAPER_FRAME
    frame_freedom = mechanism.FrameFreedom(base="x")  # the rails run along base x
    base_joint, platform_joint, length = "S", "B", "l"

    def leg_vectors(self, geometry: Geometries, poses: PoseBatch, joints: Array) -> tuple[Array, Array]:
        # Products of small matrices are twice as fast in one layout.
        b = geometry["B"] @ np.ascontiguousarray(np.swapaxes(poses.rotations, -1, -2))
        v = geometry["S"] - poses.positions[:, None, :] - b
        v[..., 0] += joints
        return b, v

    def residual_and_jacobian(
        self, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        b, v = self.leg_vectors(geometry, poses, joints)
        lengths = geometry["l"]
        errors = (np.einsum("nij,nij->ni", v, v) - lengths**2) / (2.0 * lengths)
        return errors, by_pose(b, -v / lengths[..., None])

    def derivatives(
        self, geometry: Geometry, poses: PoseBatch, joints: Array
    ) -> mechanism.ConstraintDerivatives:
        b, v = self.leg_vectors(geometry, poses, joints)
        n = v / geometry["l"][:, None]
        by_length = -0.5 * (np.sum(n * n, axis=-1, keepdims=True) + 1.0)
        by_parameters = np.concatenate([n, -n @ poses.rotations, by_length], axis=-1)
        return mechanism.ConstraintDerivatives(by_pose(b, -n), n[..., 0], by_parameters)

    def inverse(self, geometry: Geometry, branch: mechanism.Branch, poses: PoseBatch) -> Array:
        _, v = self.leg_vectors(geometry, poses, np.zeros(6))
        along_rail_squared = geometry["l"] ** 2 - v[..., 1] ** 2 - v[..., 2] ** 2
        reachable = along_rail_squared >= 0.0
        along_rail = np.sqrt(np.where(reachable, along_rail_squared, np.nan))
        return np.asarray(branch) * along_rail - v[..., 0]

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        _, v = self.leg_vectors(geometry, poses, joints)
        return np.where(v[..., 0] < 0.0, -1, 1)

    def convention_frames(self, geometry: Geometry) -> FrameTransform:
        """Origin at S2, S3 turned about x to the same height, platform axes through B2, B5 and B3."""
        S, B = geometry["S"], geometry["B"]
        apart = S[2] - S[1]
        if (across := np.hypot(apart[1], apart[2])) < CLOSEST_JOINTS_MM:
            raise UsageError("two slider joints that fix the frame are on one rail")
        y, z = apart[1:] / across
        roll = np.array([[1.0, 0.0, 0.0], [0.0, y, z], [0.0, -z, y]])
        return FrameTransform(roll, S[1].copy(), axes_through(B[1], B[4], B[2], "platform"))

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """The joints on the sliders, along x."""
        moved = np.zeros((6, 3, 6))
        moved[np.arange(6), 0, np.arange(6)] = 1.0
        return self.parameters.changes("S", moved)

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> mechanism.Guides | None:
        _, v = self.leg_vectors(geometry, poses, joints)
        n = v / geometry["l"][:, None]
        return mechanism.Guides(RAILS, along=geometry["S"][:, 0] + joints, across=n[..., 1:])
