"""Systematic effects: what the kinematic model leaves out, and what one unit of it does to a pose.

An effect is a number of independent causes of the same size, such as the scale errors of six encoders.
Each cause is a column: the error of the pose, or of the gauges' readings, that one unit of it makes, to
first order. An error ``df`` of the constraints, which is in mm of leg length, moves the platform by
``-J^-1 df`` (:mod:`hexacell.kinematics.sensitivity`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import Enum
from functools import cached_property

import numpy as np

from hexacell.identification.problem.prior import MeasuredPoses, SystematicErrors
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import ConstraintDerivatives, Guides, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

UM = 1e-3
"""A micrometre in mm."""


class Occurrence(Enum):
    """When an effect acts, and whether it is the same each time."""

    CONSTANT = "the same while measuring and at work"
    EVERY_STOP = "another at every stop"
    MEASURING = "while measuring only"
    AT_WORK = "at work only"
    STOPS_AT_WORK = "another at every stop at work, in the noise while measuring"
    WITH_TOOL = "with the tool, which takes no part in measuring"

    @property
    def is_in_records(self) -> bool:
        """Whether it acts while measuring."""
        return self in {Occurrence.CONSTANT, Occurrence.EVERY_STOP, Occurrence.MEASURING}

    @property
    def differs_at_stops(self) -> bool:
        """Whether it is another one at every task pose."""
        return self in {Occurrence.EVERY_STOP, Occurrence.STOPS_AT_WORK}


@dataclass(frozen=True, eq=False)
class Placement:
    """A robot at n poses, with the joint variables (n, 6), mm, that close its geometry there."""

    mechanism: Mechanism
    geometry: Geometry
    poses: PoseBatch
    joints: Array

    def __len__(self) -> int:
        return len(self.poses)

    @cached_property
    def derivatives(self) -> ConstraintDerivatives:
        """Derivatives of the constraints."""
        return self.mechanism.derivatives(self.geometry, self.poses, self.joints)

    @cached_property
    def guides(self) -> Guides | None:
        """The guides of the sliders, if there are any."""
        return self.mechanism.guides(self.geometry, self.poses, self.joints)

    @cached_property
    def by_constraints(self) -> Array:
        """Derivatives (n, 6, 6) of the pose, mm and rad, by errors of the constraints, mm."""
        return np.asarray(-np.linalg.inv(self.derivatives.pose))

    def by_joints(self, errors: Array) -> Array:
        """Errors of the poses (n, 6, k) by errors (n, 6, k), mm, of the joint variables."""
        return np.asarray(self.by_constraints @ (self.derivatives.joints[..., None] * errors))

    def by_parameters(self, changes: Array) -> Array:
        """Errors of the poses (n, 6, k) by changes (P, k) of the parameters."""
        parameters = self.mechanism.parameters
        of_legs = np.empty_like(changes)
        of_legs[parameters.leg_order] = changes
        by_leg = of_legs.reshape(6, parameters.numbers_per_leg, -1)
        return np.asarray(
            self.by_constraints @ np.einsum("nic,ick->nik", self.derivatives.parameters, by_leg)
        )


@dataclass(frozen=True, eq=False)
class RecordPlacement(Placement):
    """A robot at n records, and what the gauges saw there.

    Attributes:
        deviations: (n, 3), mm, along the base axes.
        gauges: (3, 3), columns: measuring directions of the gauges.
    """

    deviations: Array
    gauges: Array

    @classmethod
    def of(cls, measured: MeasuredPoses) -> RecordPlacement:
        """The robot at measured poses."""
        return cls(**{one.name: getattr(measured, one.name) for one in fields(cls)})


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """A systematic effect: independent causes, each with the same standard deviation.

    Attributes:
        name: in tables, unique within a budget.
        size: one standard deviation of each cause, in ``unit``; of a wave, its amplitude.
        source: where the size comes from.
        occurrence: when it acts.
        on_poses: errors of poses (n, 6, k), mm and rad, in the base frame, by one unit of each cause.
        on_readings: likewise errors (n, 3, k), mm, of the deviations that the gauges measure.
        is_estimated: the estimator has these causes as nuisance parameters of this size, so that the
            covariance of its result contains them.
        value: best estimate of each cause, where it was measured; ``size`` is what is not known of that.
    """

    name: str
    size: float
    unit: str
    occurrence: Occurrence
    on_poses: Callable[[Placement], Array] | None = None
    on_readings: Callable[[RecordPlacement], Array] | None = None
    source: str = ""
    is_estimated: bool = False
    value: float = 0.0


def errors_of_records(effect: Effect, records: RecordPlacement) -> Array:
    """Errors (n, 3, k), mm, of the records by one unit of each cause of an effect."""
    parts: list[Array] = [np.zeros((len(records), 3, 0))]
    if effect.on_poses is not None:
        parts.append(effect.on_poses(records)[:, :3])
    if effect.on_readings is not None:
        parts.append(effect.on_readings(records))
    return np.concatenate(parts, axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class RecordEffects:
    """The errors of records by effects, for the tests of an identification.

    Effects that the estimator has as unknowns of its own are left out.
    """

    effects: tuple[Effect, ...]

    def __call__(self, measured: MeasuredPoses, /) -> SystematicErrors:
        """The errors of n records at measured poses."""
        records = RecordPlacement.of(measured)
        common: list[Array] = [np.zeros((len(records), 3, 0))]
        own = np.zeros((len(records), 3, 3))
        for effect in self.effects:
            if not effect.size or effect.is_estimated or not effect.occurrence.is_in_records:
                continue
            errors = effect.size * errors_of_records(effect, records)
            if effect.occurrence is Occurrence.EVERY_STOP:
                own = own + errors @ np.swapaxes(errors, -1, -2)
            else:
                common.append(errors)
        return SystematicErrors(np.concatenate(common, axis=-1), own)
