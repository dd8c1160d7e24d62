"""A mechanism for hexacell from another package: six carriages on one circular rail, six fixed legs.

Carriage i is at the angle ``t = (s_i + q_i) / r_i`` of a circle about base z, with the joint of its leg at
the radius ``r_i`` and the height ``z_i``; the joint variable q is an arc, mm. With ``p = P + R b_i`` the
leg closes when

    |S - p| = l_i,    S = (r cos t, r sin t, z).

Its inverse is closed: with d and u the radius and the angle of p,

    cos(t - u) = (r^2 + d^2 + (z - p_z)^2 - l^2) / (2 r d),

which has two solutions: a carriage is on one side of its platform joint or on the other (branch).

The rail fixes the base frame but for a turn about its axis and a shift along it. With the three turns of
the platform frame, five of 42 numbers are free to choose, and 37 are left.
"""

import numpy as np

from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import Legs, axes_through, by_pose
from hexacell.kinematics.mechanism import (
    Branch,
    ConstraintDerivatives,
    FrameConvention,
    FrameFreedom,
    Guides,
    MechanismWords,
)
from hexacell.kinematics.parameters import MachinePart, ParameterKind, ParameterSet
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array

PARAMETERS = ParameterSet(
    (
        ParameterKind(
            "ring",
            ("r", "s", "z"),
            meaning="joints on the carriages: radius, arc at q = 0, height, mm, legs 1 to 6",
            tolerance_meaning="radius, arc and height of a joint on a carriage",
            part=MachinePart.BASE,
            default_tolerance=1.0,
        ),
        ParameterKind(
            "B",
            ("x", "y", "z"),
            meaning="joints on the platform in the platform frame (origin: the ball), mm",
            tolerance_meaning="every coordinate of a joint on the platform",
            part=MachinePart.PLATFORM,
            default_tolerance=1.0,
            has_ball_offset=True,
        ),
        ParameterKind(
            "l",
            (),
            meaning="leg lengths, mm",
            tolerance_meaning="every leg length",
            part=MachinePart.LEGS,
            default_tolerance=1.0,
            display="leg {leg} length",
            is_positive=True,
        ),
    )
)

CARRIAGE_1_FRAME = FrameConvention(
    name="carriage 1; platform joints 1, 3 and 5",
    parameters=PARAMETERS,
    zero=("ring1s", "ring1z"),
    equal=(("B1z", "B3z", "B5z"), ("B1y", "B3y")),
)


class Ring:
    """The mechanism: what :class:`hexacell.kinematics.mechanism.Mechanism` asks for."""

    name = "ring"
    words = MechanismWords("ring robot", joint="carriage")
    parameters = PARAMETERS
    convention = CARRIAGE_1_FRAME
    frame_freedom = FrameFreedom(shift="z", base="z")

    def residual_and_jacobian(
        self, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        b, v = _leg_vectors(geometry, poses, joints)
        length = np.linalg.norm(v, axis=-1)
        return length - geometry["l"], by_pose(b, -v / length[..., None])

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        b, v = _leg_vectors(geometry, poses, joints)
        n = v / np.linalg.norm(v, axis=-1, keepdims=True)
        angle = _angles(geometry, joints)
        outward = n[..., 0] * np.cos(angle) + n[..., 1] * np.sin(angle)
        along = n[..., 1] * np.cos(angle) - n[..., 0] * np.sin(angle)
        of_ring = np.stack([outward - angle * along, along, n[..., 2]], axis=-1)
        by_length = -np.ones((*joints.shape, 1))
        by_parameters = np.concatenate([of_ring, -n @ poses.rotations, by_length], axis=-1)
        return ConstraintDerivatives(pose=by_pose(b, -n), joints=along, parameters=by_parameters)

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        x, y, z = np.moveaxis(poses.positions[:, None, :] + _platform(geometry, poses), -1, 0)
        radius, arc, height = np.moveaxis(geometry["ring"], -1, 0)
        squares = radius**2 + x**2 + y**2 + (height - z) ** 2 - geometry["l"] ** 2
        cosine = squares / (2.0 * radius * np.hypot(x, y))
        away = np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
        turned = np.arctan2(y, x) + np.asarray(branch) * away - arc / radius
        joints: Array = radius * _wrapped(turned)  # half a turn to either side of where q = 0 is
        return joints

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        x, y, _ = np.moveaxis(poses.positions[:, None, :] + _platform(geometry, poses), -1, 0)
        return np.where(_wrapped(_angles(geometry, joints) - np.arctan2(y, x)) < 0.0, -1, 1)

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        radius, arc, height = geometry["ring"][0]
        base = _turn_about_z(-arc / radius)
        B = geometry["B"]
        platform = axes_through(B[0], B[2], B[4], "platform")
        change = FrameTransform(base, np.array([0.0, 0.0, height]), platform)
        moved = self.change_frames(geometry, change)
        return self.convention.geometry(self.convention.free_parameters(moved)), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        radius, arc, height = np.moveaxis(geometry["ring"], -1, 0)
        turn = np.arctan2(change.base[1, 0], change.base[0, 0])
        ring = np.stack([radius, arc + radius * turn, height - change.origin[2]], axis=-1)
        B = geometry["B"] @ change.platform.T
        return Geometry.of(PARAMETERS, {"ring": ring, "B": B, "l": geometry["l"]})

    def encoder_zeros(self, geometry: Geometry) -> Array:
        moved = np.zeros((6, 3, 6))
        moved[np.arange(6), 1, np.arange(6)] = 1.0
        return self.parameters.changes("ring", moved)

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        return None

    def legs(self, geometry: Geometries, poses: PoseBatch, joints: Array) -> Legs:
        b, v = _leg_vectors(geometry, poses, joints)
        at_platform = poses.positions[:, None, :] + b
        return Legs(at_platform + v, at_platform, poses.rotations)

    def platform_radius(self, geometry: Geometries) -> Array:
        radius: Array = np.mean(np.linalg.norm(geometry["B"], axis=-1), axis=-1)
        return radius


def _platform(geometry: Geometries, poses: PoseBatch) -> Array:
    """R b_i (n, 6, 3), mm."""
    vectors: Array = geometry["B"] @ np.swapaxes(poses.rotations, -1, -2)
    return vectors


def _angles(geometry: Geometries, joints: Array) -> Array:
    """Where the carriages are on the ring (n, 6), rad."""
    ring = geometry["ring"]
    angles: Array = (ring[..., 1] + joints) / ring[..., 0]
    return angles


def _leg_vectors(geometry: Geometries, poses: PoseBatch, joints: Array) -> tuple[Array, Array]:
    """R b_i (n, 6, 3), and the vectors (n, 6, 3) from platform joint to carriage joint, mm."""
    b, angle, ring = _platform(geometry, poses), _angles(geometry, joints), geometry["ring"]
    radius, height = ring[..., 0], np.broadcast_to(ring[..., 2], angle.shape)
    carriage = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    return b, carriage - poses.positions[:, None, :] - b


def _wrapped(angles: Array) -> Array:
    wrapped: Array = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped


def _turn_about_z(angle: float) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
