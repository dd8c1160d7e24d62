"""A mechanism whose encoders may have errors of scale: one further number a leg.

An encoder that shows q stands for the joint variable ``(1 + s) q``, s its error of scale. Where encoders
have their zeros needs no further numbers: every mechanism has its own
(:meth:`~hexacell.kinematics.mechanism.Mechanism.encoder_zeros`).

Encoders of lengths that are all wrong alike make a machine that is larger by that share, and no record
shows it. How large it is, the tolerances alone determine (``size`` of
:class:`~hexacell.kinematics.mechanism.FrameFreedom`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import overload

import numpy as np

from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import (
    Branch,
    ConstraintDerivatives,
    FrameConvention,
    FrameTransform,
    Guides,
    Mechanism,
)
from hexacell.kinematics.parameters import ParameterKind, ParameterSet, ParameterUnit
from hexacell.kinematics.pose import PoseBatch
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


class WithEncoderScales:
    """A :class:`~hexacell.kinematics.mechanism.Mechanism`: another one with errors of scale."""

    def __init__(self, exact: Mechanism) -> None:
        self.exact = exact
        self.name, self.words = exact.name, exact.words
        own = exact.parameters
        self.parameters = ParameterSet((*own.kinds, ENCODER_SCALE), own.has_branch)
        rules = exact.convention
        self.convention = FrameConvention(rules.name, self.parameters, rules.zero, rules.equal)
        self.frame_freedom = replace(exact.frame_freedom, size=True)

    def residual_and_jacobian(
        self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array
    ) -> tuple[Array, Array]:
        """Length errors of the legs (n, 6), mm, and their derivatives by the pose (n, 6, 6)."""
        return self.exact.residual_and_jacobian(self._exact(geometry), poses, _actual(geometry, joints))

    def derivatives(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> ConstraintDerivatives:
        """Derivatives of the legs' length errors by pose, joint variables and parameters."""
        exact = self.exact.derivatives(self._exact(geometry), poses, _actual(geometry, joints))
        by_scale = (exact.joints * joints)[..., None]
        return ConstraintDerivatives(
            pose=exact.pose,
            joints=exact.joints * (1.0 + geometry["encoder_scale"]),
            parameters=np.concatenate([exact.parameters, by_scale], axis=-1),
        )

    def inverse(self, geometry: Geometry, branch: Branch, poses: PoseBatch) -> Array:
        """Joint variables (n, 6) at n poses; NaN out of reach."""
        actual = self.exact.inverse(self._exact(geometry), branch, poses)
        shown: Array = actual / (1.0 + geometry["encoder_scale"])
        return shown

    def branch(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
        """The inverse solution, -1 or 1, that each leg is on (n, 6)."""
        return self.exact.branch(self._exact(geometry), poses, _actual(geometry, joints))

    def normalize_frames(self, geometry: Geometry) -> tuple[Geometry, FrameTransform]:
        """The machine in the frames of the convention, and the change of frames."""
        exact, change = self.exact.normalize_frames(self._exact(geometry))
        return self.with_scales(exact, geometry["encoder_scale"]), change

    def change_frames(self, geometry: Geometry, change: FrameTransform) -> Geometry:
        """The geometry of the machine in other frames."""
        changed = self.exact.change_frames(self._exact(geometry), change)
        return self.with_scales(changed, geometry["encoder_scale"])

    def encoder_zeros(self, geometry: Geometry) -> Array:
        """The exact mechanism's, by as much as an encoder stands for that shows 1 less."""
        exact = self.exact.encoder_zeros(self._exact(geometry)) * (1.0 + geometry["encoder_scale"])
        return np.vstack([exact, np.zeros((len(self.parameters) - len(exact), exact.shape[1]))])

    def guides(self, geometry: Geometry, poses: PoseBatch, joints: Array) -> Guides | None:
        """The guides of the sliders at n poses."""
        return self.exact.guides(self._exact(geometry), poses, _actual(geometry, joints))

    def legs(self, geometry: Geometry | GeometryBatch, poses: PoseBatch, joints: Array) -> Legs:
        """The legs in space at n poses."""
        return self.exact.legs(self._exact(geometry), poses, _actual(geometry, joints))

    def platform_radius(self, geometry: Geometry | GeometryBatch) -> Array:
        """Mean distance of the platform joints from the ball, mm."""
        return self.exact.platform_radius(self._exact(geometry))

    def with_scales(self, exact: Geometry, scales: Array) -> Geometry:
        """A geometry of the exact mechanism with errors of scale (6,)."""
        return Geometry(self.parameters, np.concatenate([exact.vector, scales]))

    def without_scales(self, geometry: Geometry) -> Geometry:
        """The geometry of the exact mechanism."""
        return Geometry(self.exact.parameters, geometry.vector[: len(self.exact.parameters)])

    @overload
    def _exact(self, geometry: Geometry) -> Geometry: ...

    @overload
    def _exact(self, geometry: Geometry | GeometryBatch) -> Geometry | GeometryBatch: ...

    def _exact(self, geometry: Geometry | GeometryBatch) -> Geometry | GeometryBatch:
        if isinstance(geometry, Geometry):
            return self.without_scales(geometry)
        own = self.exact.parameters
        return GeometryBatch(own, geometry.vectors[:, : len(own)])


def _actual(geometry: Geometry | GeometryBatch, joints: Array) -> Array:
    """The joint variables (n, 6) of those that the encoders show."""
    actual: Array = joints * (1.0 + geometry["encoder_scale"])
    return actual
