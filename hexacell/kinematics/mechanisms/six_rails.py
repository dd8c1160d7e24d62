"""6-PUS with any rails: six sliders, each on a rail of its own direction, six fixed legs, one platform.

Leg i closes when ``|S_i + q_i e_i - P - R B_i| = l_i``. The constraint used is the difference of both
sides, the leg's error in mm. Rails may be vertical (Linapod), slanted, crossed or parallel; the Hexaglide
is the special case in which all have the direction x.

**Directions.** Rail i is where a turn about base x by ``a`` and base y by ``b``, at once, puts the z axis:

    e = (b s, -a s, cos t),    s = sin t / t,    t = sqrt(a^2 + b^2),

two numbers in rad: (0, 0) is vertical, (0, pi/2) along x, (-pi/2, 0) along y. Near z they are the angles
by which the rail leans. The only direction without such numbers is -z: let a vertical slider count upward.

**Frames.** The base frame is free in three shifts and three turns, the platform's in three turns: 54
numbers, 45 of them free. Rail 1 is the z axis, the joint of its slider at q = 0 the origin, and that of
slider 3 in the half plane x > 0, y = 0. A direction is measured over the whole travel of a slider, so that
this frame is nearer to the gauges' axes than one through three joints. Seen from rail 1, no other rail may
count the opposite way.

Sources: Merlet, Parallel Robots, 2nd ed. 2006; Pritschow and Wurst, CIRP Annals 46, 1997 (Linapod).
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
from hexacell.kinematics.parameters import MachinePart, ParameterKind, ParameterSet, ParameterUnit
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.turned_axes import turns_of

SIX_RAILS_PARAMETERS = ParameterSet(
    (
        ParameterKind(
            "S",
            ("x", "y", "z"),
            meaning="spherical joints in the base frame at q = 0, mm, legs 1 to 6",
            tolerance_meaning="every coordinate of a spherical joint",
            part=MachinePart.BASE,
            default_tolerance=2.0,
        ),
        ParameterKind(
            "rail",
            ("a", "b"),
            meaning="directions of the rails: turns about base x and y that put the z axis there, rad",
            tolerance_meaning="both turns of every rail",
            unit=ParameterUnit.RAD,
            default_tolerance=0.002,
        ),
        ParameterKind(
            "B",
            ("x", "y", "z"),
            meaning="universal joints in the platform frame (origin: the ball), mm",
            tolerance_meaning="every coordinate of a universal joint",
            part=MachinePart.PLATFORM,
            default_tolerance=2.0,
            has_ball_offset=True,
        ),
        ParameterKind(
            "l",
            (),
            meaning="leg lengths, mm",
            tolerance_meaning="every leg length",
            part=MachinePart.LEGS,
            default_tolerance=2.0,
            display="leg {leg} length",
            is_positive=True,
        ),
    )
)

FIRST_RAIL_FRAME = FrameConvention(
    name="rail 1, slider 3; platform joints 1, 3 and 5",
    parameters=SIX_RAILS_PARAMETERS,
    zero=("S1x", "S1y", "S1z", "S3y", "rail1a", "rail1b"),
    equal=(("B1z", "B3z", "B5z"), ("B1y", "B3y")),
)

OWN_RAILS = tuple((leg,) for leg in range(6))
"""Each slider has a rail of its own."""

SMALL = 1e-6
"""Largest angle, rad, that is taken for its sine."""

OPPOSITE_RAD = 3.0
"""Rails that are farther apart than this count the opposite way."""


class SixRails:
    """6-PUS with any rails as a :class:`~hexacell.kinematics.mechanism.Mechanism`; stateless."""

    name = "six-rails"
    words = MechanismWords("six-rail robot", joint="slider", guide="rail")
    parameters = SIX_RAILS_PARAMETERS
    convention = FIRST_RAIL_FRAME
    frame_freedom = FrameFreedom()

    def residual_and_jacobian(
        self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        """Length errors of the legs (n, 6), mm, and their derivatives by the pose (n, 6, 6)."""
        b, v = _leg_vectors(geometry, poses, joints)
        length = np.sqrt(np.einsum("nij,nij->ni", v, v))
        return length - geometry["l"], by_pose(b, -v / length[..., None])

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        """Derivatives of the legs' length errors by pose, joint variables and parameters."""
        b, v = _leg_vectors(geometry, poses, joints)
        n = v / np.linalg.norm(v, axis=-1, keepdims=True)
        directions, by_turns = directions_of_rails(geometry["rail"])
        by_rail = joints[..., None] * np.einsum("nij,ijk->nik", n, by_turns)
        by_length = -np.ones((*joints.shape, 1))
        return ConstraintDerivatives(
            pose=by_pose(b, -n),
            joints=np.einsum("nij,ij->ni", n, directions),
            parameters=np.concatenate([n, by_rail, -n @ poses.rotations, by_length], axis=-1),
        )

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses; NaN out of reach."""
        _, v = _leg_vectors(geometry, poses, np.zeros((len(poses), 6)))
        along = np.einsum("nij,ij->ni", v, _directions(geometry["rail"]))
        squared = geometry["l"] ** 2 - np.einsum("nij,nij->ni", v, v) + along**2
        root = np.sqrt(np.where(squared >= 0.0, squared, np.nan))
        joints: Array = np.asarray(branch) * root - along
        return joints

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """The inverse solution, -1 or 1, that each leg is on (n, 6)."""
        _, v = _leg_vectors(geometry, poses, joints)
        along = np.einsum("nij,ij->ni", v, _directions(geometry["rail"]))
        return np.where(along < 0.0, -1, 1)

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        """Rail 1 along z from the origin, slider 3 at y = 0, x > 0; the platform's joints 1, 3 and 5."""
        S, B = geometry["S"], geometry["B"]
        base = _axes_along(_directions(geometry["rail"])[0], S[2] - S[0])
        change = FrameTransform(base, S[0].copy(), axes_through(B[0], B[2], B[4], "platform"))
        moved = self.change_frames(geometry, change)
        if np.linalg.norm(moved["rail"], axis=-1).max() > OPPOSITE_RAD:
            raise UsageError("a slider counts the opposite way of slider 1")
        # Later code relies on the rules being exact; the rotations satisfy them only to rounding.
        return self.convention.geometry(self.convention.free_parameters(moved)), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        """The geometry of the machine in other frames."""
        return six_rails_geometry(
            (geometry["S"] - change.origin) @ change.base.T,
            turns_of(_directions(geometry["rail"]) @ change.base.T),
            geometry["B"] @ change.platform.T,
            geometry["l"],
        )

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """Changes (P, 6) of the parameters by the encoders' zeros: the sliders, along their rails."""
        moved = np.zeros((6, 3, 6))
        moved[np.arange(6), :, np.arange(6)] = _directions(geometry["rail"])
        return self.parameters.changes("S", moved)

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        """The guides of the sliders at n poses."""
        _, v = _leg_vectors(geometry, poses, joints)
        n = v / np.linalg.norm(v, axis=-1, keepdims=True)
        directions, by_turns = directions_of_rails(geometry["rail"])
        along = np.einsum("ij,ij->i", geometry["S"], directions) + joints
        across = np.einsum("nij,ijk->nik", n, by_turns / np.linalg.norm(by_turns, axis=1, keepdims=True))
        return Guides(OWN_RAILS, along, across)

    def legs(self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array) -> Legs:
        """The legs in space at n poses."""
        b, v = _leg_vectors(geometry, poses, joints)
        at_platform = poses.positions[:, None, :] + b
        return Legs(at_platform + v, at_platform, poses.rotations)

    def platform_radius(self, geometry: Geometry | GeometryBatch) -> Array:
        """Mean distance of the platform joints from the ball, mm."""
        return mean_radius(geometry, "B")


def six_rails_geometry(S: ArrayLike, rail: ArrayLike, B: ArrayLike, l: ArrayLike) -> Geometry:  # noqa: E741
    """The geometry of slider joints S (6, 3), rails (6, 2), platform joints B (6, 3), lengths l (6,)."""
    return Geometry.of(SIX_RAILS_PARAMETERS, {"S": S, "rail": rail, "B": B, "l": l})


def directions_of_rails(turns: Array) -> tuple[Array, Array]:
    """Unit vectors (..., 3) along rails by their turns (..., 2), rad, and their derivatives (..., 3, 2)."""
    a, b = turns[..., 0], turns[..., 1]
    squared = a * a + b * b
    cosine, sine = np.cos(np.sqrt(squared)), np.sinc(np.sqrt(squared) / np.pi)
    # Of the quotient below the difference vanishes like the square: -1/3 at zero.
    change = np.where(squared < SMALL**2, -1.0 / 3.0, (cosine - sine) / np.where(squared, squared, 1.0))
    directions = np.stack([b * sine, -a * sine, cosine], axis=-1)
    by_a = np.stack([a * b * change, -sine - a * a * change, -a * sine], axis=-1)
    by_b = np.stack([sine + b * b * change, -a * b * change, -b * sine], axis=-1)
    return directions, np.stack([by_a, by_b], axis=-1)


def _directions(turns: Array) -> Array:
    return directions_of_rails(turns)[0]


def _leg_vectors(
    geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
) -> tuple[Array, Array]:
    """R B_i (n, 6, 3), and the vectors (n, 6, 3) from platform joint to slider joint, mm."""
    b = geometry["B"] @ np.swapaxes(poses.rotations, -1, -2)
    slider = geometry["S"] + joints[..., None] * _directions(geometry["rail"])
    return b, slider - poses.positions[:, None, :] - b


def _axes_along(axis: Array, toward: Array) -> Array:
    """The axes (3, 3), in rows: z along ``axis``, ``toward`` in the half plane y = 0, x > 0."""
    x = toward - (toward @ axis) * axis
    if (across := np.linalg.norm(x)) < CLOSEST_JOINTS_MM:
        raise UsageError("two slider joints that fix the frame are on one rail")
    x /= across
    return np.stack([x, np.cross(axis, x), axis])
