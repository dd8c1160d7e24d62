"""6-RUS: six motors with cranks, six rods of fixed length, one platform.

The end of crank i is on a circle about the motor's axis. With its centre ``c_i``, its radius ``r_i``, the
angle ``t = z_i + q_i`` and two axes ``u_i``, ``w_i`` of its plane, rod i closes when

    |c_i + r_i (u_i cos t + w_i sin t) - P - R B_i| = l_i.

The constraint used is the difference of both sides, the rod's error in mm. The joint variable q is the
encoder's angle, in deg, and so is the crank's angle z where that is 0. The inverse is closed: the crank's
end is on its circle and on a sphere about the platform's joint, which has two solutions (branch).

**Axes.** The axis of motor i is where turns about base x and base y, at once, put the z axis
(:mod:`hexacell.kinematics.turned_axes`), and ``u``, ``w`` are where they put x and y. The only direction
without such numbers is -z; seen from the convention's base frame, no motor's axis may point that way.

**Frames.** The centre is that of the circle, so that no freedom along the axis is left. The base frame is
free in three shifts and three turns, the platform's in three turns: 66 numbers, 57 of them free. The base
frame is that of the centres 1, 3 and 5, as of a Gough-Stewart platform. The size of the machine is free
too, and seen by the gauges only, as no encoder measures a length: deviations of some millimetres, with
gauges whose scale is known to 1e-3. It is no choice of frames, because a machine that is larger errs by
that. So it stays a parameter, which the drawing's tolerances determine, all lengths together, and its
uncertainty is theirs.

Sources: Merlet, Parallel Robots, 2nd ed. 2006; Pierrot, Dauchez and Fournier, HEXA, IEEE ICAR 1991.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.legs import Legs, axes_through, by_pose, mean_radius
from hexacell.kinematics.mechanism import (
    Branch,
    ConstraintDerivatives,
    FrameConvention,
    FrameFreedom,
    FrameTransform,
    Guides,
    MechanismWords,
)
from hexacell.kinematics.parameters import (
    JointUnit,
    MachinePart,
    ParameterKind,
    ParameterSet,
    ParameterUnit,
)
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.turned_axes import TurnedAxes, turns_of

ROTARY_CRANKS_PARAMETERS = ParameterSet(
    (
        ParameterKind(
            "centre",
            ("x", "y", "z"),
            meaning="centres of the cranks' circles in the base frame, mm, legs 1 to 6",
            tolerance_meaning="every coordinate of a centre",
            part=MachinePart.BASE,
            default_tolerance=0.5,
        ),
        ParameterKind(
            "axis",
            ("a", "b"),
            meaning="directions of the motors' axes: turns about base x and y that put z there, rad",
            tolerance_meaning="both turns of every axis",
            unit=ParameterUnit.RAD,
            default_tolerance=0.002,
        ),
        ParameterKind(
            "crank",
            (),
            meaning="lengths of the cranks, mm",
            tolerance_meaning="every crank length",
            part=MachinePart.BASE,
            default_tolerance=0.2,
            display="crank {leg} length",
            is_positive=True,
        ),
        ParameterKind(
            "zero",
            (),
            meaning="angles of the cranks where their encoders show 0, deg",
            tolerance_meaning="every angle at 0",
            unit=ParameterUnit.DEG,
            default_tolerance=0.5,
            display="crank {leg} zero",
        ),
        ParameterKind(
            "platform",
            ("x", "y", "z"),
            meaning="joints on the platform in the platform frame (origin: the ball), mm",
            tolerance_meaning="every coordinate of a joint on the platform",
            part=MachinePart.PLATFORM,
            default_tolerance=0.5,
            has_ball_offset=True,
        ),
        ParameterKind(
            "rod",
            (),
            meaning="lengths of the rods, mm",
            tolerance_meaning="every rod length",
            part=MachinePart.LEGS,
            default_tolerance=0.2,
            display="rod {leg} length",
            is_positive=True,
        ),
    )
)

THREE_CENTRES_FRAME = FrameConvention(
    name="centres and platform joints of legs 1, 3 and 5",
    parameters=ROTARY_CRANKS_PARAMETERS,
    zero=("centre1x", "centre1y", "centre1z", "centre3y", "centre3z", "centre5z"),
    equal=(("platform1z", "platform3z", "platform5z"), ("platform1y", "platform3y")),
)

OPPOSITE_RAD = 3.0
"""Axes that are farther than this from base z are too near its opposite."""


class RotaryCranks:
    """6-RUS as a :class:`~hexacell.kinematics.mechanism.Mechanism`; stateless."""

    name = "rotary-cranks"
    words = MechanismWords("robot with cranks", joint="crank", joint_unit=JointUnit.DEG)
    parameters = ROTARY_CRANKS_PARAMETERS
    convention = THREE_CENTRES_FRAME
    frame_freedom = FrameFreedom(size=True)

    def residual_and_jacobian(
        self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        """Length errors of the legs (n, 6), mm, and their derivatives by the pose (n, 6, 6)."""
        b, v = _rods(geometry, poses, joints)
        length = np.sqrt(np.einsum("nij,nij->ni", v, v))
        return length - geometry["rod"], by_pose(b, -v / length[..., None])

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        """Derivatives of the legs' length errors by pose, joint variables and parameters."""
        b, v = _rods(geometry, poses, joints)
        n = v / np.linalg.norm(v, axis=-1, keepdims=True)
        axes, crank = TurnedAxes.by(geometry["axis"]), geometry["crank"]
        cosine, sine = _cosine_and_sine(geometry, joints)
        outward = np.einsum("nij,nij->ni", n, axes.u * cosine + axes.w * sine)
        along = np.einsum("nij,nij->ni", n, axes.w * cosine - axes.u * sine)
        turned = axes.u_by_turns * cosine[..., None] + axes.w_by_turns * sine[..., None]
        by_axis = crank[:, None] * np.einsum("nij,nijk->nik", n, turned)
        by_angle = np.radians(crank * along)
        by_rod = -np.ones_like(by_angle)
        numbers = (outward[..., None], by_angle[..., None], -n @ poses.rotations, by_rod[..., None])
        return ConstraintDerivatives(
            pose=by_pose(b, -n),
            joints=by_angle,
            parameters=np.concatenate([n, by_axis, *numbers], axis=-1),
        )

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses; within half a turn of where q is 0."""
        across, rest = _in_plane(geometry, poses)
        wanted = rest / (2.0 * geometry["crank"])
        cosine = wanted / np.hypot(across[..., 0], across[..., 1])
        away = np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
        angles = np.arctan2(across[..., 1], across[..., 0]) + np.asarray(branch) * away
        joints: Array = _wrapped(np.degrees(angles) - geometry["zero"])
        return joints

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """The inverse solution, -1 or 1, that each leg is on (n, 6)."""
        across, _ = _in_plane(geometry, poses)
        cosine, sine = _cosine_and_sine(geometry, joints)
        beyond = sine[..., 0] * across[..., 0] - cosine[..., 0] * across[..., 1]
        return np.where(beyond < 0.0, -1, 1)

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        """Origin at centre 1, centre 3 on the x axis, 5 at height 0; the platform likewise."""
        centre, platform = geometry["centre"], geometry["platform"]
        change = FrameTransform(
            axes_through(centre[0], centre[2], centre[4], "base"),
            centre[0].copy(),
            axes_through(platform[0], platform[2], platform[4], "platform"),
        )
        moved = self.change_frames(geometry, change)
        if np.linalg.norm(moved["axis"], axis=-1).max() > OPPOSITE_RAD:
            raise UsageError("the axis of a motor points downward from the centres 1, 3 and 5")
        # Later code relies on the rules being exact; the rotations satisfy them only to rounding.
        return self.convention.geometry(self.convention.free_parameters(moved)), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        """The geometry of the machine in other frames."""
        before = TurnedAxes.by(geometry["axis"])
        turns = turns_of(before.axis @ change.base.T)
        after = TurnedAxes.by(turns)
        angles = np.radians(geometry["zero"])[:, None]
        at_zero = (before.u * np.cos(angles) + before.w * np.sin(angles)) @ change.base.T
        zero = np.arctan2(np.sum(at_zero * after.w, axis=-1), np.sum(at_zero * after.u, axis=-1))
        values = {
            "centre": (geometry["centre"] - change.origin) @ change.base.T,
            "axis": turns,
            "crank": geometry["crank"],
            "zero": geometry["zero"] + _wrapped(np.degrees(zero) - geometry["zero"]),
            "platform": geometry["platform"] @ change.platform.T,
            "rod": geometry["rod"],
        }
        return Geometry.of(ROTARY_CRANKS_PARAMETERS, values)

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """Changes (P, 6) of the parameters by the encoders' zeros: the cranks' zeros."""
        return self.parameters.changes("zero", np.eye(6))

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        """None: its legs have no guides."""
        return None

    def legs(self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array) -> Legs:
        """The rods in space at n poses."""
        b, v = _rods(geometry, poses, joints)
        at_platform = poses.positions[:, None, :] + b
        axes, (cosine, sine) = TurnedAxes.by(geometry["axis"]), _cosine_and_sine(geometry, joints)
        outward, along = axes.u * cosine + axes.w * sine, axes.w * cosine - axes.u * sine
        carriers = np.stack([outward, along, np.broadcast_to(axes.axis, outward.shape)], axis=-1)
        return Legs(at_platform + v, at_platform, poses.rotations, carriers)

    def platform_radius(self, geometry: Geometry | GeometryBatch) -> Array:
        """Mean distance of the platform joints from the ball, mm."""
        return mean_radius(geometry, "platform")


def _cosine_and_sine(geometry: Geometry | GeometryBatch, joints: Array) -> tuple[Array, Array]:
    """Cosine and sine of the cranks' angles, (n, 6, 1) each."""
    angles = np.radians(geometry["zero"] + joints)[..., None]
    return np.cos(angles), np.sin(angles)


def _platform(geometry: Geometry | GeometryBatch, poses: PoseBatch) -> Array:
    """R B_i (n, 6, 3), mm."""
    vectors: Array = geometry["platform"] @ np.swapaxes(poses.rotations, -1, -2)
    return vectors


def _rods(geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array) -> tuple[Array, Array]:
    """R B_i (n, 6, 3), and the vectors (n, 6, 3) from platform joint to crank's end, mm."""
    b = _platform(geometry, poses)
    return b, _ends(geometry, joints) - poses.positions[:, None, :] - b


def _ends(geometry: Geometry | GeometryBatch, joints: Array) -> Array:
    """The joints (n, 6, 3) at the ends of the cranks, in the base frame, mm."""
    axes, (cosine, sine) = TurnedAxes.by(geometry["axis"]), _cosine_and_sine(geometry, joints)
    ends: Array = geometry["centre"] + geometry["crank"][..., None] * (axes.u * cosine + axes.w * sine)
    return ends


def _in_plane(geometry: Geometry, poses: PoseBatch) -> tuple[Array, Array]:
    """From the centres to the platform joints along u and w (n, 6, 2), mm, and a sum of squares (n, 6).

    The rod closes where ``2 r (x cos t + y sin t)`` is the latter, mm^2.
    """
    axes = TurnedAxes.by(geometry["axis"])
    away = poses.positions[:, None, :] + _platform(geometry, poses) - geometry["centre"]
    across = np.stack([np.einsum("nij,ij->ni", away, each) for each in (axes.u, axes.w)], axis=-1)
    squares = np.einsum("nij,nij->ni", away, away) + geometry["crank"] ** 2 - geometry["rod"] ** 2
    return across, squares


def _wrapped(degrees: Array) -> Array:
    """Angles less whole turns, within half a turn of 0, deg."""
    wrapped: Array = (degrees + 180.0) % 360.0 - 180.0
    return wrapped


def rotary_cranks_geometry(
    centre: ArrayLike,
    axis: ArrayLike,
    crank: ArrayLike,
    zero: ArrayLike,
    platform: ArrayLike,
    rod: ArrayLike,
) -> Geometry:
    """The geometry of centres (6, 3), axes (6, 2), cranks, zeros, platform joints (6, 3) and rods."""
    values = {
        "centre": centre,
        "axis": axis,
        "crank": crank,
        "zero": zero,
        "platform": platform,
        "rod": rod,
    }
    return Geometry.of(ROTARY_CRANKS_PARAMETERS, values)
