"""Systematic effects: what the kinematic model leaves out, and what one unit of it does to a pose.

An effect is a number of independent causes of the same size, such as the scale errors of six encoders.
Each cause is a column: the error of the pose, or of the gauges' readings, that one unit of it makes, to
first order. An error ``df`` of the constraints, which is in mm of leg length, moves the platform by
``-J^-1 df`` (:mod:`hexacell.kinematics.sensitivity`).
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from hexacell.identification.placement import Placement, RecordPlacement
from hexacell.identification.problem.prior import SystematicErrors
from hexacell.kinematics.rotations import Array

THOUSANDTH = 1e-3
"""A micrometre in mm, a millidegree in deg."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """A systematic effect: independent causes, each with the same standard deviation.

    Attributes:
        name: in tables, unique within a budget.
        size: one standard deviation of each cause, in ``unit``; of a wave, its amplitude.
        on_poses: errors of poses (n, 6, k), mm and rad, in the base frame, by one unit of each cause.
        on_readings: likewise errors (n, 3, k), mm, of the deviations that the gauges measure.
        is_estimated: the estimator has these causes as nuisance parameters of this size, so that the
            covariance of its result contains them.
        value: best estimate of each cause, where it was measured; ``size`` is what is not known of that.
        freedom: degrees of freedom of ``size``, where it was measured by repetition.
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
    freedom: float = np.inf


def errors_of_records(effect: Effect, records: RecordPlacement) -> Array:
    """Errors (n, 3, k), mm, of the records by one unit of each cause of an effect."""
    parts: list[Array] = [np.zeros((len(records), 3, 0))]
    if effect.on_poses is not None:
        parts.append(effect.on_poses(records)[:, :3])
    if effect.on_readings is not None:
        parts.append(effect.on_readings(records))
    return np.concatenate(parts, axis=-1)


def errors_by_effects(effects: Iterable[Effect], records: RecordPlacement) -> SystematicErrors:
    """The errors of n records by effects, for the tests of an identification.

    Effects that the estimator has as unknowns of its own are left out.
    """
    common: list[Array] = [np.zeros((len(records), 3, 0))]
    own = np.zeros((len(records), 3, 3))
    for effect in effects:
        if not effect.size or effect.is_estimated or not effect.occurrence.is_in_records:
            continue
        errors = effect.size * errors_of_records(effect, records)
        if effect.occurrence is Occurrence.EVERY_STOP:
            own = own + errors @ np.swapaxes(errors, -1, -2)
        else:
            common.append(errors)
    return SystematicErrors(np.concatenate(common, axis=-1), own)
