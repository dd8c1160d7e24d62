"""Errors of the records of a length check, by their sources.

Some causes are shared with the geometry that is judged: its covariance, and constant effects such as the
scale of each encoder. All others act on the records of the check alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.problem.problem import Noise
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import ParameterUnit
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import Effect, Occurrence
from hexacell.uncertainty.encoder_effects import COMMON_SCALE
from hexacell.uncertainty.length_records import LengthRecords, LengthStandard
from hexacell.uncertainty.propagation import each_alone
from hexacell.uncertainty.record_effects import errors_of_records


@dataclass(frozen=True, slots=True, eq=False)
class JudgedGeometry:
    """What is known of the geometry that is judged.

    Attributes:
        covariance: (p, p) of its free parameters.
        parameter_columns: errors (p, k) of these by one unit of each cause of an effect, by its name.
    """

    covariance: Array
    parameter_columns: Mapping[str, Array]

    def with_scale(self, mechanism: Mechanism, geometry: Geometry) -> JudgedGeometry:
        """With what a common scale did to it: if nothing else is known, the geometry took up all of it."""
        if COMMON_SCALE in self.parameter_columns:
            return self
        parameters = mechanism.parameters.parameters
        rows = mechanism.convention.free_rows()
        is_length = np.array([parameters[row].kind.unit is ParameterUnit.MM for row in rows])
        smaller = -1e-6 * mechanism.convention.free_parameters(geometry) * is_length
        return replace(
            self, parameter_columns={**self.parameter_columns, COMMON_SCALE: smaller[:, np.newaxis]}
        )


@dataclass(frozen=True, slots=True, eq=False)
class LengthError:
    """Errors of the records by one source.

    Attributes:
        name: of the source.
        columns: (n, 3, k) of the places, mm, by one standard deviation of each of its causes.
        is_shared: whether the judged geometry has the same causes.
    """

    name: str
    columns: Array
    is_shared: bool = False


def shared_errors(records: LengthRecords, jacobian: Array, judged: JudgedGeometry, effect: Effect) -> Array:
    """Errors (n, 3, k) of the places by one unit of each cause that the judged geometry has as well.

    ``jacobian`` (n, 3, p) is that of the positions. What is constant acts on the ball of the records too.
    """
    columns = judged.parameter_columns.get(effect.name)
    through = None if columns is None else jacobian @ columns
    if effect.occurrence is not Occurrence.CONSTANT:
        return np.zeros((len(records), 3, 0)) if through is None else through
    direct = -errors_of_records(effect, records.placement, records.readings)
    return direct if through is None else through + direct


def errors_by_effect(records: LengthRecords, effect: Effect, shared: Array) -> Iterator[LengthError]:
    """Errors by the causes that are shared, and by those that act on these records alone."""
    if not effect.is_estimated:  # else the covariance has them
        yield LengthError(effect.name, effect.size * shared, is_shared=True)
    if effect.occurrence is Occurrence.EVERY_STOP:
        yield LengthError(
            effect.name,
            effect.size * each_alone(errors_of_records(effect, records.placement, records.readings)),
        )
    elif effect.occurrence is not Occurrence.CONSTANT:
        yield LengthError(
            effect.name, effect.size * errors_of_records(effect, records.placement, records.readings)
        )


def errors_by_gauges(
    records: LengthRecords, standard: LengthStandard, noise: Noise
) -> Iterator[LengthError]:
    """Where the gauges sit at each mounting, and how they are turned against the base."""
    mountings = np.unique(records.mountings)
    sits = records.mountings[:, None] == mountings
    seated = np.einsum("nm,ab->namb", sits, np.eye(3)).reshape(len(records), 3, -1)
    yield LengthError("seating of the gauges", standard.seating_mm * seated)
    turned = np.cross(np.eye(3), records.deviations[:, None]).swapaxes(1, 2)
    yield LengthError("alignment of the gauges", noise.alignment * turned)
    second = records.seats[:, None, None] == 1
    yield LengthError("alignment of the gauges", standard.parallel * np.where(second, turned, 0.0))
