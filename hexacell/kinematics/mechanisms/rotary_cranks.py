"""6-RUS: six motors with cranks, six rods of fixed length, one platform.

The end of crank i is on a circle about the motor's axis. With its centre ``c_i``, its radius ``r_i``, the
angle ``t = z_i + q_i`` and two axes ``u_i``, ``w_i`` of its plane, rod i closes when

    |c_i + r_i (u_i cos t + w_i sin t) - P - R B_i| = l_i.

The constraint used is the difference of both sides, the rod's error in mm. The joint variable q is the
encoder's angle, in deg, and so is the crank's angle z where that is 0. The inverse is closed: the crank's
end is on its circle and on a sphere about the platform's joint, which has two solutions (branch).

**Axes.** The axis of motor i is where turns about base x and base y, at once, put the z axis
(:mod:`hexacell.kinematics.rotations`), and ``u``, ``w`` are where they put x and y. The only direction
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

from dataclasses import replace

import numpy as np

from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import Branch, FrameConvention, FrameFreedom, MechanismWords
from hexacell.kinematics.mechanisms.gough_stewart import PLATFORM_JOINT
from hexacell.kinematics.mechanisms.jointed_legs import JointedLegs
from hexacell.kinematics.parameters import (
    JointUnit,
    MachinePart,
    ParameterKind,
    ParameterSet,
    ParameterUnit,
)
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array, TurnedAxes, turns_of

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
        replace(PLATFORM_JOINT, default_tolerance=0.5),
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


class RotaryCranks(JointedLegs):
    """6-RUS."""

    name = "rotary-cranks"
    words = MechanismWords("robot with cranks", joint="crank", joint_unit=JointUnit.DEG)
    parameters = ROTARY_CRANKS_PARAMETERS
    convention = THREE_CENTRES_FRAME
    frame_freedom = FrameFreedom(size=True)
    base_joint, platform_joint, length, axis = "centre", "platform", "rod", "axis"
    opposite = "the axis of a motor points downward from the centres 1, 3 and 5"

    def base_ends(self, geometry: Geometries, joints: Array) -> Array:
        axes, (cosine, sine) = TurnedAxes.by(geometry["axis"]), _cosine_and_sine(geometry, joints)
        return geometry["centre"] + geometry["crank"][..., None] * (axes.u * cosine + axes.w * sine)

    def derivatives_at_base(self, geometry: Geometry, joints: Array, n: Array) -> tuple[Array, list[Array]]:
        axes, crank = TurnedAxes.by(geometry["axis"]), geometry["crank"]
        cosine, sine = _cosine_and_sine(geometry, joints)
        outward = np.einsum("nij,nij->ni", n, axes.u * cosine + axes.w * sine)
        along = np.einsum("nij,nij->ni", n, axes.w * cosine - axes.u * sine)
        u_by_turns, w_by_turns, _ = axes.by_turns
        turned = u_by_turns * cosine[..., None] + w_by_turns * sine[..., None]
        by_axis = crank[:, None] * np.einsum("nij,nijk->nik", n, turned)
        by_angle = np.radians(crank * along)
        return by_angle, [by_axis, outward[..., None], by_angle[..., None]]

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses, within half a turn of where q is 0; NaN out of reach."""
        across, rest = self._in_plane(geometry, poses)
        wanted = rest / (2.0 * geometry["crank"])
        cosine = wanted / np.hypot(across[..., 0], across[..., 1])
        away = np.arccos(np.where(np.abs(cosine) <= 1.0, cosine, np.nan))
        angles = np.arctan2(across[..., 1], across[..., 0]) + np.asarray(branch) * away
        return _wrapped(np.degrees(angles) - geometry["zero"])

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        across, _ = self._in_plane(geometry, poses)
        cosine, sine = _cosine_and_sine(geometry, joints)
        beyond = sine[..., 0] * across[..., 0] - cosine[..., 0] * across[..., 1]
        return np.where(beyond < 0.0, -1, 1)

    def turned(self, geometry: Geometry, change: FrameTransform) -> dict[str, Array]:
        before = TurnedAxes.by(geometry["axis"])
        turns = turns_of(before.axis @ change.base.T)
        after = TurnedAxes.by(turns)
        angles = np.radians(geometry["zero"])[:, None]
        at_zero = (before.u * np.cos(angles) + before.w * np.sin(angles)) @ change.base.T
        zero = np.arctan2(np.sum(at_zero * after.w, axis=-1), np.sum(at_zero * after.u, axis=-1))
        zeros = geometry["zero"] + _wrapped(np.degrees(zero) - geometry["zero"])
        return {"axis": turns, "zero": zeros}

    def encoder_zeros(self, geometry: Geometry) -> Array:
        return self.parameters.changes("zero", np.eye(6))

    def legs(self, geometry: Geometries, poses: PoseBatch, joints: Array) -> Legs:
        axes, (cosine, sine) = TurnedAxes.by(geometry["axis"]), _cosine_and_sine(geometry, joints)
        outward, along = axes.u * cosine + axes.w * sine, axes.w * cosine - axes.u * sine
        carriers = np.stack([outward, along, np.broadcast_to(axes.axis, outward.shape)], axis=-1)
        return replace(super().legs(geometry, poses, joints), carriers=carriers)

    def _in_plane(self, geometry: Geometry, poses: PoseBatch) -> tuple[Array, Array]:
        """From the centres to the platform joints along u and w (n, 6, 2), mm, and a sum of squares (n, 6).

        The rod closes where ``2 r (x cos t + y sin t)`` is the latter, mm^2.
        """
        axes = TurnedAxes.by(geometry["axis"])
        b = geometry["platform"] @ np.swapaxes(poses.rotations, -1, -2)
        away = poses.positions[:, None, :] + b - geometry["centre"]
        across = np.stack([np.einsum("nij,ij->ni", away, each) for each in (axes.u, axes.w)], axis=-1)
        squares = np.einsum("nij,nij->ni", away, away) + geometry["crank"] ** 2 - geometry["rod"] ** 2
        return across, squares


def _cosine_and_sine(geometry: Geometries, joints: Array) -> tuple[Array, Array]:
    """Cosine and sine of the cranks' angles, (n, 6, 1) each."""
    angles = np.radians(geometry["zero"] + joints)[..., None]
    return np.cos(angles), np.sin(angles)


def _wrapped(degrees: Array) -> Array:
    """Angles less whole turns, within half a turn of 0, deg."""
    return (degrees + 180.0) % 360.0 - 180.0
