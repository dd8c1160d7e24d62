"""What all mechanisms here have in common: a leg from a joint at the base's end to one on the platform.

Here the joints at the base's end are fixed; a mechanism that moves them says where they are.
"""

import numpy as np

from hexacell.errors import UsageError
from hexacell.kinematics.geometry import Geometries, Geometry
from hexacell.kinematics.legs import Legs, axes_through, by_pose
from hexacell.kinematics.mechanism import ConstraintDerivatives, Guides, Mechanism
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array

OPPOSITE_RAD = 3.0
"""Axes that are farther than this from z are too near its opposite."""


class JointedLegs(Mechanism):
    """A mechanism whose constraint is a leg's length less what it should be, mm; stateless.

    The parameters of a leg are, in this order, those of its joint at the base's end, others, those of its
    joint on the platform, and its length. The attributes are the symbols of these kinds; ``axis`` is that
    of two turns that put z along a leg's rail or motor, and ``opposite`` what is wrong where they put it
    along -z of the convention's base frame, which they can hardly say.
    """

    base_joint: str
    platform_joint: str
    length: str
    axis: str | None = None
    opposite: str = ""

    def base_ends(self, geometry: Geometries, joints: Array) -> Array:
        """The joints at the base's end, (n, J, 3) or (J, 3), in the base frame, mm."""
        return geometry[self.base_joint]

    def derivatives_at_base(self, geometry: Geometry, joints: Array, n: Array) -> tuple[Array, list[Array]]:
        """Derivatives of the lengths by joint variables (n, J) and other parameters at the base (n, J, c).

        ``n`` (n, J, 3) are the directions of the legs, from the platform to the base.
        """
        return -np.ones_like(joints), []

    def platform_joints(self, geometry: Geometries) -> Array:
        """The legs' joints on the platform, (n, J, 3) or (J, 3), in its frame, mm."""
        return geometry[self.platform_joint]

    def derivatives_at_platform(self, poses: PoseBatch, n: Array) -> Array:
        """Derivatives (n, J, c) of the lengths by the parameters of the joints on the platform."""
        return -n @ poses.rotations

    def lengths(self, geometry: Geometries, joints: Array) -> Array:
        """How long the legs should be, mm, (n, J) or (J,)."""
        return geometry[self.length]

    def leg_vectors(self, geometry: Geometries, poses: PoseBatch, joints: Array) -> tuple[Array, Array]:
        """R B_i (n, J, 3), and the vectors (n, J, 3) from the platform joints to the base's end, mm."""
        b = self.platform_joints(geometry) @ np.swapaxes(poses.rotations, -1, -2)
        return b, self.base_ends(geometry, joints) - poses.positions[:, None, :] - b

    def residual_and_jacobian(
        self, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        b, v = self.leg_vectors(geometry, poses, joints)
        length = np.sqrt(np.einsum("nij,nij->ni", v, v))
        return length - self.lengths(geometry, joints), by_pose(b, -v / length[..., None])

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        b, v = self.leg_vectors(geometry, poses, joints)
        n = v / np.sqrt(np.einsum("nij,nij->ni", v, v))[..., None]
        by_joints, by_others = self.derivatives_at_base(geometry, joints, n)
        by_length = -np.ones((*joints.shape, 1))
        at_platform = self.derivatives_at_platform(poses, n)
        by_parameters = np.concatenate([n, *by_others, at_platform, by_length], axis=-1)
        return ConstraintDerivatives(by_pose(b, -n), by_joints, by_parameters)

    def convention_frames(self, geometry: Geometry) -> FrameTransform:
        """The change to the convention's frames: here those of the joints of legs 1, 3 and 5."""
        base, platform = geometry[self.base_joint], geometry[self.platform_joint]
        return FrameTransform(
            axes_through(base[0], base[2], base[4], "base"),
            base[0].copy(),
            axes_through(platform[0], platform[2], platform[4], "platform"),
        )

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        change = self.convention_frames(geometry)
        moved = self.change_frames(geometry, change)
        # Later code relies on the rules being exact; the rotations satisfy them only to rounding.
        normal = self.convention.geometry(self.convention.free_parameters(moved))
        if self.axis is not None and np.linalg.norm(normal[self.axis], axis=-1).max() > OPPOSITE_RAD:
            raise UsageError(self.opposite)
        return normal, change

    def turned(self, geometry: Geometry, change: FrameTransform) -> dict[str, Array]:
        """The further kinds that turns of the base frame change, in other frames."""
        return {}

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        values = {symbol: geometry[symbol] for symbol in self.parameters.shapes}
        values[self.base_joint] = (values[self.base_joint] - change.origin) @ change.base.T
        values[self.platform_joint] = values[self.platform_joint] @ change.platform.T
        return Geometry.of(self.parameters, values | self.turned(geometry, change))

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        return None

    def legs(self, geometry: Geometries, poses: PoseBatch, joints: Array) -> Legs:
        b, v = self.leg_vectors(geometry, poses, joints)
        at_platform = poses.positions[:, None, :] + b
        return Legs(at_platform + v, at_platform, poses.rotations)

    def platform_radius(self, geometry: Geometries) -> Array:
        def compute() -> Array:
            joints = self.platform_joints(geometry)
            return np.asarray(np.sqrt(np.einsum("...i,...i->...", joints, joints)).mean(axis=-1))

        return geometry.once("mean radius", compute)
