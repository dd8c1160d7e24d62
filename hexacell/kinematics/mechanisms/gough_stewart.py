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
from numpy.typing import ArrayLike

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


class GoughStewart:
    """The Gough-Stewart platform as a :class:`~hexacell.kinematics.mechanism.Mechanism`; stateless."""

    name = "gough-stewart"
    words = MechanismWords("Gough-Stewart platform", joint="leg")
    parameters = GOUGH_STEWART_PARAMETERS
    convention = THREE_LEGS_FRAME
    frame_freedom = FrameFreedom()

    def residual_and_jacobian(
        self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        """Length errors of the legs (n, 6), mm, and their derivatives by the pose (n, 6, 6)."""
        b, length, n = _legs(geometry, poses)
        return length - geometry["offset"] - joints, by_pose(b, n)

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        """Derivatives of the legs' length errors by pose, joint variables and parameters."""
        b, _, n = _legs(geometry, poses)
        by_length = -np.ones((*joints.shape, 1))
        return ConstraintDerivatives(
            pose=by_pose(b, n),
            joints=by_length[..., 0],
            parameters=np.concatenate([-n, n @ poses.rotations, by_length], axis=-1),
        )

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses; every pose has a solution."""
        joints: Array = _legs(geometry, poses)[1] - geometry["offset"]
        return joints

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """The inverse solution, -1 or 1, that each leg is on (n, 6)."""
        return np.ones_like(joints)

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        """Origin at base joint 1, base joint 3 on the x axis, 5 at height 0; the platform likewise."""
        base, platform = geometry["base"], geometry["platform"]
        change = FrameTransform(
            axes_through(base[0], base[2], base[4], "base"),
            base[0].copy(),
            axes_through(platform[0], platform[2], platform[4], "platform"),
        )
        moved = self.change_frames(geometry, change)
        # Later code relies on the rules being exact; the rotations satisfy them only to rounding.
        return self.convention.geometry(self.convention.free_parameters(moved)), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        """The geometry of the machine in other frames."""
        base = (geometry["base"] - change.origin) @ change.base.T
        return gough_stewart_geometry(base, geometry["platform"] @ change.platform.T, geometry["offset"])

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """Changes (P, 6) of the parameters by the encoders' zeros: the offsets."""
        return self.parameters.changes("offset", np.eye(6))

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        """None: its legs have no guides."""
        return None

    def legs(self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array) -> Legs:
        """The legs in space at n poses."""
        b, length, n = _legs(geometry, poses)
        at_platform = poses.positions[:, None, :] + b
        return Legs(at_platform - length[..., None] * n, at_platform, poses.rotations)

    def platform_radius(self, geometry: Geometry | GeometryBatch) -> Array:
        """Mean distance of the platform joints from the ball, mm."""
        return mean_radius(geometry, "platform")


def gough_stewart_geometry(base: ArrayLike, platform: ArrayLike, offset: ArrayLike) -> Geometry:
    """The geometry of joints on base and platform (6, 3) and offsets of the legs (6,), mm."""
    values = {"base": base, "platform": platform, "offset": offset}
    return Geometry.of(GOUGH_STEWART_PARAMETERS, values)


def _legs(geometry: Geometry | GeometryBatch, poses: PoseBatch) -> tuple[Array, Array, Array]:
    """R b_i (n, 6, 3), mm, the legs' lengths (n, 6), mm, and their directions (n, 6, 3) to the platform."""
    b = geometry["platform"] @ np.swapaxes(poses.rotations, -1, -2)
    v = poses.positions[:, None, :] + b - geometry["base"]
    length = np.sqrt(np.einsum("nij,nij->ni", v, v))
    return b, length, v / length[..., None]
