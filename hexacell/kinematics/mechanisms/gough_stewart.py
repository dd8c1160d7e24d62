"""The 6-UPS Gough-Stewart platform: six legs of variable length between a base and a platform.

Leg i closes when ``|P + R b_i - a_i| = o_i + q_i``, with the joints ``a_i`` on the base and ``b_i`` on the
platform, the reading q of the leg's encoder and the leg's length o where that is 0. The constraint used is
the difference of both sides, the leg's error in mm. The inverse has one solution a leg: there are no
branches.

Base and platform joints have the names that LinuxCNC's ``genhexkins`` gives them. It has no offsets: there
q is the whole length, so that they are zero, and what is identified of them belongs into the home offsets.

**Frames.** No record sees where the origin of the base frame is (3), or how the platform frame is turned
about the ball (3). Turns of the base frame (3) are seen against the gauges only: by a deviation d, a turn f
changes what they show by ``f x d``. Deviations are some millimetres, and gauges are set up along the axes
to some tenths of a degree. What they add is less than what is known of their alignment, so these turns are
no parameters of the machine either. Nine rules fix all nine, and leave 33 of 42 numbers. They use the legs
1, 3 and 5, as two neighbours may be close to each other on one of the two plates.

**Screws.** Legs that are screws become longer when they are turned in their nuts.
Where nothing holds a screw, universal joints turn it against its nut when the platform tilts, while its
motor stands still. With the direction u of the leg, the axis a of its joint on the base and the axis w of
that on the platform, where it is now,

    c = lead / (2 pi) arcsin(m . p),   m = u x (a x u) / |...|,   p = w x u / |...|,

and the leg closes when ``|P + R b_i - a_i| + c = o_i + q_i``. It is the correction of LinuxCNC's
``genhexkins``, whose pins ``base-n``, ``platform-n`` and ``screw-lead`` have the same numbers.

Lead and axes are known beforehand and not identified: an axis that is off by 1 mrad makes a leg with a lead
of 5 mm wrong by 0.8 um. Each axis goes with its plate, in the frame of the joints of legs 1, 3 and 5 there.
So it is the same in all choices of frames.

Sources: Merlet, Parallel Robots, 2nd ed. 2006; LinuxCNC, ``genhexkins.c``, with function
``StrutLengthCorrection``; its derivatives are own.
"""

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics import mechanism
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import by_pose
from hexacell.kinematics.mechanisms.jointed_legs import JointedLegs
from hexacell.kinematics.parameters import MachinePart, ParameterKind, ParameterSet
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

PLATFORM_JOINT = ParameterKind(
    "platform",
    ("x", "y", "z"),
    meaning="joints on the platform in the platform frame (origin: the ball), mm",
    tolerance_meaning="every coordinate of a joint on the platform",
    part=MachinePart.PLATFORM,
    default_tolerance=1.0,
    has_ball_offset=True,
)

GOUGH_STEWART_PARAMETERS = ParameterSet(
    (
        ParameterKind(
            "base",
            ("x", "y", "z"),
            meaning="joints on the base in the base frame, mm, legs 1 to 6",
            tolerance_meaning="every coordinate of a joint on the base",
            part=MachinePart.BASE,
            default_tolerance=1.0,
        ),
        PLATFORM_JOINT,
        ParameterKind(
            "offset",
            (),
            meaning="lengths of the legs where their encoders show 0, mm",
            tolerance_meaning="every leg's length at 0",
            part=MachinePart.LEGS,
            default_tolerance=1.0,
            display="leg {leg} offset",
        ),
    ),
    has_branch=False,
)

THREE_LEGS_FRAME = mechanism.FrameConvention(
    name="joints of legs 1, 3 and 5",
    parameters=GOUGH_STEWART_PARAMETERS,
    zero=("base1x", "base1y", "base1z", "base3y", "base3z", "base5z"),
    equal=(("platform1z", "platform3z", "platform5z"), ("platform1y", "platform3y")),
)


class GoughStewart(JointedLegs):
    """The Gough-Stewart platform; its lengths are what the encoders show, from the offsets on."""

    name = "gough-stewart"
    words = mechanism.MechanismWords("Gough-Stewart platform", joint="leg")
    parameters = GOUGH_STEWART_PARAMETERS
    convention = THREE_LEGS_FRAME
    frame_freedom = mechanism.FrameFreedom()
    base_joint, platform_joint, length = "base", "platform", "offset"

    def lengths(self, geometry: Geometries, joints: Array) -> Array:
        return geometry["offset"] + joints

    def inverse(self, geometry: Geometry, branch: mechanism.Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses; every pose has a solution."""
        _, v = self.leg_vectors(geometry, poses, np.zeros(self.joint_count))
        joints: Array = np.linalg.norm(v, axis=-1) - geometry["offset"]
        return joints

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        return np.ones_like(joints)

    def encoder_zeros(self, geometry: Geometry) -> Array:
        return self.parameters.changes("offset", np.eye(self.joint_count))


@dataclass(frozen=True, slots=True, eq=False)
class _Corrections:
    """What the screws add to the legs (n, 6), mm, and how that changes.

    ``by_vector`` (n, 6, 3) is by the leg's vector, the platform's axis fixed; ``by_turn`` by a turn of that
    axis, rad, the vector fixed.
    """

    added: Array
    by_vector: Array
    by_turn: Array


class ScrewLegs(GoughStewart):
    """The platform with the correction; its axes are stated for the frames of ``drawing``.

    Derivatives by parameters are those with the axes where they are: in the convention's frames no free
    parameter turns them.

    Args:
        lead_mm: of one turn of the screws; above zero for right-handed threads.
        base_axes: (6, 3) of the joints on the base that the legs turn about, in the base frame.
        platform_axes: (6, 3) likewise on the platform, in the platform frame.
        drawing: the geometry for whose frames the axes are stated.

    Raises:
        UsageError: the joints of legs 1, 3 and 5 on a plate fix no frame.
    """

    def __init__(self, lead_mm: float, base_axes: Array, platform_axes: Array, drawing: Geometry) -> None:
        _, change = self.normalize_frames(drawing)
        self._radius_mm = lead_mm / (2.0 * np.pi)
        self._base_axes = base_axes @ change.base.T
        self._platform_axes = platform_axes @ change.platform.T

    def residual_and_jacobian(
        self, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        residual, jacobian = super().residual_and_jacobian(geometry, poses, joints)
        b, found = self._corrections(geometry, poses)
        return residual + found.added, jacobian + _by_pose(b, found)

    def derivatives(
        self, geometry: Geometry, poses: PoseBatch, joints: Array
    ) -> mechanism.ConstraintDerivatives:
        without = super().derivatives(geometry, poses, joints)
        b, found = self._corrections(geometry, poses)
        by_joints = [-found.by_vector, found.by_vector @ poses.rotations, np.zeros((*joints.shape, 1))]
        return mechanism.ConstraintDerivatives(
            pose=without.pose + _by_pose(b, found),
            joints=without.joints,
            parameters=without.parameters + np.concatenate(by_joints, axis=-1),
        )

    def inverse(self, geometry: Geometry, branch: mechanism.Branch, poses: PoseBatch) -> Array:
        without = super().inverse(geometry, branch, poses)
        return without + self._corrections(geometry, poses)[1].added

    def _corrections(self, geometry: Geometries, poses: PoseBatch) -> tuple[Array, _Corrections]:
        """R b_i (n, 6, 3), mm, and the corrections."""
        to_base = np.swapaxes(poses.rotations, -1, -2)
        b = geometry["platform"] @ to_base
        vectors = poses.positions[:, None, :] + b - geometry["base"]
        axes = self._base_axes @ _frames(geometry["base"])
        turned = self._platform_axes @ _frames(geometry["platform"]) @ to_base
        return b, _corrected(vectors, axes, turned, self._radius_mm)


def _corrected(vectors: Array, a: Array, w: Array, radius_mm: float) -> _Corrections:
    """Corrections by the legs' vectors (n, 6, 3) and the axes (..., 6, 3) on base and platform."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    u = vectors / length
    along = _dot(a, u)
    m, m_size = _unit(a - along * u)
    p, p_size = _unit(np.cross(w, u))
    sine = _dot(m, p)
    by_m, by_p = (p - sine * m) / m_size, (m - sine * p) / p_size
    scale = radius_mm / np.sqrt(1.0 - sine**2)
    by_direction = np.cross(by_p, w) - along * by_m
    by_vector = scale * (by_direction - _dot(by_direction, u) * u) / length
    by_turn = scale * np.cross(w, np.cross(u, by_p))
    return _Corrections(radius_mm * np.arcsin(sine[..., 0]), by_vector, by_turn)


def _by_pose(b: Array, found: _Corrections) -> Array:
    """Derivatives (n, 6, 6) of the corrections by the pose."""
    jacobian = by_pose(b, found.by_vector)
    jacobian[..., 3:] += found.by_turn
    return jacobian


def _frames(joints: Array) -> Array:
    """The axes (..., 3, 3), in rows, that the joints (..., 6, 3) of legs 1, 3 and 5 fix."""
    first, second, third = (joints[..., leg, :] for leg in (0, 2, 4))
    x, _ = _unit(second - first)
    z, _ = _unit(np.cross(x, third - first))
    return np.stack([x, np.cross(z, x), z], axis=-2)


def _unit(vectors: Array) -> tuple[Array, Array]:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / size, size


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", one, other)[..., None])
