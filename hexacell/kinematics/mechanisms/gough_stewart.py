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

Sources: Merlet, Parallel Robots, 2nd ed. 2006; LinuxCNC, ``genhexkins.c``.
"""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanism import Branch, FrameConvention, FrameFreedom, MechanismWords
from hexacell.kinematics.mechanisms.jointed_legs import JointedLegs
from hexacell.kinematics.parameters import MachinePart, ParameterKind, ParameterSet
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

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
        ParameterKind(
            "platform",
            ("x", "y", "z"),
            meaning="joints on the platform in the platform frame (origin: the ball), mm",
            tolerance_meaning="every coordinate of a joint on the platform",
            part=MachinePart.PLATFORM,
            default_tolerance=1.0,
            has_ball_offset=True,
        ),
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

THREE_LEGS_FRAME = FrameConvention(
    name="joints of legs 1, 3 and 5",
    parameters=GOUGH_STEWART_PARAMETERS,
    zero=("base1x", "base1y", "base1z", "base3y", "base3z", "base5z"),
    equal=(("platform1z", "platform3z", "platform5z"), ("platform1y", "platform3y")),
)


class GoughStewart(JointedLegs):
    """The Gough-Stewart platform; its lengths are what the encoders show, from the offsets on."""

    name = "gough-stewart"
    words = MechanismWords("Gough-Stewart platform", joint="leg")
    parameters = GOUGH_STEWART_PARAMETERS
    convention = THREE_LEGS_FRAME
    frame_freedom = FrameFreedom()
    base_joint, platform_joint, length = "base", "platform", "offset"

    def lengths(self, geometry: Geometry | GeometryBatch, joints: Array) -> Array:
        lengths: Array = geometry["offset"] + joints
        return lengths

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses; every pose has a solution."""
        _, v = self.leg_vectors(geometry, poses, np.zeros(6))
        joints: Array = np.linalg.norm(v, axis=-1) - geometry["offset"]
        return joints

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        return np.ones_like(joints)

    def encoder_zeros(self, geometry: Geometry) -> Array:
        return self.parameters.changes("offset", np.eye(6))
