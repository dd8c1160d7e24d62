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

from dataclasses import replace

import numpy as np

from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import CLOSEST_JOINTS_MM, axes_through
from hexacell.kinematics.mechanism import Branch, FrameConvention, FrameFreedom, Guides, MechanismWords
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.mechanisms.jointed_legs import JointedLegs
from hexacell.kinematics.parameters import ParameterKind, ParameterSet, ParameterUnit, each_of
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array, TurnedAxes, turns_of

_SLIDER_JOINT, _PLATFORM_JOINT, _LENGTH = (
    replace(kind, default_tolerance=2.0) for kind in HEXAGLIDE_PARAMETERS.kinds
)
_RAIL = ParameterKind(
    "rail",
    ("a", "b"),
    meaning="directions of the rails: turns about base x and y that put the z axis there, rad",
    tolerance_meaning="both turns of every rail",
    unit=ParameterUnit.RAD,
    default_tolerance=0.002,
)
SIX_RAILS_PARAMETERS = ParameterSet((_SLIDER_JOINT, _RAIL, _PLATFORM_JOINT, _LENGTH))

FIRST_RAIL_FRAME = FrameConvention(
    name="rail 1, slider 3; platform joints 1, 3 and 5",
    parameters=SIX_RAILS_PARAMETERS,
    zero=("S1x", "S1y", "S1z", "S3y", "rail1a", "rail1b"),
    equal=(("B1z", "B3z", "B5z"), ("B1y", "B3y")),
)


class SixRails(JointedLegs):
    """6-PUS with any rails."""

    name = "six-rails"
    words = MechanismWords("six-rail robot", joint="slider", guide="rail")
    parameters = SIX_RAILS_PARAMETERS
    convention = FIRST_RAIL_FRAME
    frame_freedom = FrameFreedom()
    base_joint, platform_joint, length, axis = "S", "B", "l", "rail"
    opposite = "a slider counts the opposite way of slider 1"

    def base_ends(self, geometry: Geometries, joints: Array) -> Array:
        return geometry["S"] + joints[..., None] * directions(geometry)

    def derivatives_at_base(self, geometry: Geometry, joints: Array, n: Array) -> tuple[Array, list[Array]]:
        axes = TurnedAxes.by(geometry["rail"])
        by_rail = joints[..., None] * np.einsum("nij,ijk->nik", n, axes.by_turns[2])
        return np.einsum("nij,ij->ni", n, axes.axis), [by_rail]

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        _, v = self.leg_vectors(geometry, poses, np.zeros((len(poses), self.joint_count)))
        along = np.einsum("nij,ij->ni", v, directions(geometry))
        squared = geometry["l"] ** 2 - np.einsum("nij,nij->ni", v, v) + along**2
        root = np.sqrt(np.where(squared >= 0.0, squared, np.nan))
        return np.asarray(np.asarray(branch) * root - along)

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        _, v = self.leg_vectors(geometry, poses, joints)
        return np.where(np.einsum("nij,ij->ni", v, directions(geometry)) < 0.0, -1, 1)

    def convention_frames(self, geometry: Geometry) -> FrameTransform:
        """Rail 1 along z from the origin, slider 3 at y = 0, x > 0; the platform's joints 1, 3 and 5."""
        S, B = geometry["S"], geometry["B"]
        z, toward = directions(geometry)[0], S[2] - S[0]
        x = toward - (toward @ z) * z
        if (across := np.linalg.norm(x)) < CLOSEST_JOINTS_MM:
            raise UsageError("two slider joints that fix the frame are on one rail")
        x /= across
        base = np.stack([x, np.cross(z, x), z])
        return FrameTransform(base, S[0].copy(), axes_through(B[0], B[2], B[4], "platform"))

    def turned(self, geometry: Geometry, change: FrameTransform) -> dict[str, Array]:
        return {"rail": turns_of(directions(geometry) @ change.base.T)}

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """The sliders, along their rails."""
        legs = np.arange(self.joint_count)
        moved = np.zeros((len(legs), 3, len(legs)))
        moved[legs, :, legs] = directions(geometry)
        return self.parameters.changes("S", moved)

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        _, v = self.leg_vectors(geometry, poses, joints)
        n = v / np.linalg.norm(v, axis=-1, keepdims=True)
        by_turns = TurnedAxes.by(geometry["rail"]).by_turns[2]
        along = np.einsum("ij,ij->i", geometry["S"], directions(geometry)) + joints
        across = np.einsum("nij,ijk->nik", n, by_turns / np.linalg.norm(by_turns, axis=1, keepdims=True))
        return Guides(each_of(self.joint_count), along, across)


def directions(geometry: Geometries) -> Array:
    """Unit vectors (..., J, 3) along the rails."""
    return geometry.once("directions of the rails", lambda: TurnedAxes.by(geometry["rail"]).axis)
