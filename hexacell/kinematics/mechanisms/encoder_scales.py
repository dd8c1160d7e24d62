"""A mechanism whose encoders may have errors of scale: one further number a leg.

An encoder that shows q stands for the joint variable ``(1 + s) q``, s its error of scale. Where encoders
have their zeros needs no further numbers: every mechanism has its own
(:meth:`~hexacell.kinematics.mechanism.Mechanism.encoder_zeros`).

Encoders of lengths that are all wrong alike make a machine that is larger by that share, and no record
shows it. How large it is, the tolerances alone determine (``size`` of
:class:`~hexacell.kinematics.mechanism.FrameFreedom`).
"""

from dataclasses import replace

import numpy as np

from hexacell.kinematics.geometry import Geometries, GeometriesType, Geometry
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import Branch, ConstraintDerivatives, FrameConvention, Guides, Mechanism
from hexacell.kinematics.parameters import ParameterKind, ParameterSet, ParameterUnit, each_of
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array

ENCODER_SCALE = ParameterKind(
    "encoder_scale",
    (),
    meaning="errors of the encoders' scales: they show a joint variable divided by 1 + this",
    tolerance_meaning="error of every encoder's scale",
    display="leg {leg} encoder scale",
    unit=ParameterUnit.NONE,
    default=0.0,
)


class WithEncoderScales(Mechanism):
    """Another mechanism, the ``exact`` one, with errors of scale."""

    def __init__(self, exact: Mechanism) -> None:
        self.exact = exact
        self.name, self.words, self.coordinates = exact.name, exact.words, exact.coordinates
        own, legs = exact.parameters, exact.joint_count
        scale = replace(ENCODER_SCALE, owners=each_of(legs))
        self.parameters = ParameterSet((*own.kinds, scale), own.has_branch)
        rules = exact.convention
        self.convention = FrameConvention(rules.name, self.parameters, rules.zero, rules.equal)
        self.frame_freedom = replace(exact.frame_freedom, size=True)

    def residual_and_jacobian(
        self, geometry: Geometries, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        return self.exact.residual_and_jacobian(
            self.without_scales(geometry), poses, _actual(geometry, joints)
        )

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        exact = self.exact.derivatives(self.without_scales(geometry), poses, _actual(geometry, joints))
        by_scale = np.zeros((*exact.parameters.shape[:2], 1))
        by_scale[:, : joints.shape[1], 0] = exact.joints * joints
        return ConstraintDerivatives(
            pose=exact.pose,
            joints=exact.joints * (1.0 + geometry["encoder_scale"]),
            parameters=np.concatenate([exact.parameters, by_scale], axis=-1),
        )

    def completed(self, geometry: Geometry, poses: PoseBatch) -> PoseBatch:
        return self.exact.completed(self.without_scales(geometry), poses)

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        actual = self.exact.inverse(self.without_scales(geometry), branch, poses)
        return actual / (1.0 + geometry["encoder_scale"])

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        return self.exact.branch(self.without_scales(geometry), poses, _actual(geometry, joints))

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        exact, change = self.exact.normalize_frames(self.without_scales(geometry))
        return self.with_scales(exact, geometry["encoder_scale"]), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        changed = self.exact.change_frames(self.without_scales(geometry), change)
        return self.with_scales(changed, geometry["encoder_scale"])

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """The exact mechanism's, by as much as an encoder stands for that shows 1 less."""
        zeros = self.exact.encoder_zeros(self.without_scales(geometry)) * (1.0 + geometry["encoder_scale"])
        return np.vstack([zeros, np.zeros((len(self.parameters) - len(zeros), zeros.shape[1]))])

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        return self.exact.guides(self.without_scales(geometry), poses, _actual(geometry, joints))

    def legs(self, geometry: Geometries, poses: PoseBatch, joints: Array) -> Legs:
        return self.exact.legs(self.without_scales(geometry), poses, _actual(geometry, joints))

    def platform_radius(self, geometry: Geometries) -> Array:
        return self.exact.platform_radius(self.without_scales(geometry))

    def with_scales(self, exact: Geometry, scales: Array) -> Geometry:
        """A geometry of the exact mechanism with errors of scale (6,)."""
        return Geometry(self.parameters, np.concatenate([exact.vector, scales]))

    def without_scales(self, geometry: GeometriesType) -> GeometriesType:
        """The geometry of the exact mechanism, or one for each pose."""
        own = self.exact.parameters
        return geometry.with_numbers(own, geometry.vector[..., : len(own)])


def _actual(geometry: Geometries, joints: Array) -> Array:
    """The joint variables (n, 6) of those that the encoders show."""
    return joints * (1.0 + geometry["encoder_scale"])
