"""Records of a length check, the same ball in two parallel seats of a fixture, and their errors by source.

The gauges are zeroed once, in the first seat, and mounted in the two seats in turn. Where the gauges of a
mounting would show zero, the ball's centre is in the place of that seat. Some causes of errors are shared
with the judged geometry: its covariance, and constant effects. All others act on these records alone.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import IdentifiabilityError
from hexacell.identification.placement import RecordPlacement
from hexacell.identification.problem.prior import Noise
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import ParameterUnit
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effect_kinds import COMMON_SCALE
from hexacell.uncertainty.effects import Effect, Occurrence, errors_of_records
from hexacell.uncertainty.propagation import each_alone


@dataclass(frozen=True, slots=True)
class LengthStandard:
    """A fixture with two seats for the gauges; uncertainties are one standard deviation.

    Attributes:
        distance_mm: of the two places of the ball, at the temperature of the check.
        certificate_mm: of that distance.
        temperature_um_m: of the distance, by the temperature of the fixture.
        parallel: angle between the seats, about each axis, rad.
        height_mm: of the ball above the line along which the distance is certified.
        seating_mm: of the gauges' place, along each axis, at every mounting.
    """

    distance_mm: float
    certificate_mm: float
    temperature_um_m: float = 0.0
    parallel: float = 0.0
    height_mm: float = 0.0
    seating_mm: float = 0.0


@dataclass(frozen=True, eq=False)
class LengthRecords:
    """n records in the mechanism's frame convention.

    Attributes:
        mountings: (n,) number of the mounting, from 1; the first seat has the odd ones.
        placement: the robot at the records, by the geometry that is judged and the joint variables shown.
    """

    mountings: NDArray[np.int_]
    placement: RecordPlacement

    @classmethod
    def of(cls, commanded: RecordPlacement, mountings: NDArray[np.int_]) -> "LengthRecords":
        """Records whose poses are the commanded ones, under (nearly) the geometry that is judged.

        Raises:
            IdentifiabilityError: the geometry has no pose near a command at its joint variables.
        """
        mechanism, geometry = commanded.mechanism, commanded.geometry
        solved = forward_kinematics(mechanism, geometry, commanded.joints, commanded.poses)
        if not solved.found.all():
            raise IdentifiabilityError(
                "in the length check the joint variables do not belong to the commanded poses",
                action="Check that the controller commands with the geometry in its config",
            )
        return cls(mountings, replace(commanded, poses=solved.poses))

    def __len__(self) -> int:
        return len(self.mountings)

    @property
    def seats(self) -> NDArray[np.int_]:
        """(n,) 0 for the first seat and 1 for the second."""
        return (self.mountings + 1) % 2

    @property
    def places(self) -> Array:
        """(n, 3) where the ball would be with the gauges at zero, by the robot, mm."""
        return np.asarray(self.placement.poses.positions - self.placement.deviations)


@dataclass(frozen=True, slots=True, eq=False)
class JudgedGeometry:
    """What is known of the geometry that is judged.

    Attributes:
        covariance: (p, p) of its free parameters.
        parameter_columns: errors (p, k) of these by one unit of each cause of an effect, by its name.
    """

    covariance: Array
    parameter_columns: Mapping[str, Array]

    def with_scale(self, mechanism: Mechanism, geometry: Geometry) -> "JudgedGeometry":
        """With what a common scale did to it: if nothing else is known, the geometry took up all of it."""
        if COMMON_SCALE in self.parameter_columns:
            return self
        parameters = mechanism.parameters.parameters
        rows = mechanism.convention.free_rows
        is_length = np.array([parameters[row].kind.unit is ParameterUnit.MM for row in rows])
        smaller = -1e-6 * mechanism.convention.free_parameters(geometry) * is_length
        return replace(self, parameter_columns={**self.parameter_columns, COMMON_SCALE: smaller[:, None]})


@dataclass(frozen=True, slots=True, eq=False)
class LengthError:
    """Errors of the records by one source.

    Attributes:
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
    direct = -errors_of_records(effect, records.placement)
    return direct if through is None else through + direct


def errors_by_effect(records: LengthRecords, effect: Effect, shared: Array) -> Iterator[LengthError]:
    """Errors by the causes that are shared, and by those that act on these records alone."""
    if not effect.is_estimated:  # else the covariance has them
        yield LengthError(effect.name, effect.size * shared, is_shared=True)
    if effect.occurrence is not Occurrence.CONSTANT:
        errors = errors_of_records(effect, records.placement)
        own = each_alone(errors) if effect.occurrence is Occurrence.EVERY_STOP else errors
        yield LengthError(effect.name, effect.size * own)


def errors_by_gauges(
    records: LengthRecords, standard: LengthStandard, noise: Noise
) -> Iterator[LengthError]:
    """Where the gauges sit at each mounting, and how they are turned against the base."""
    sits = records.mountings[:, None] == np.unique(records.mountings)
    seated = np.einsum("nm,ab->namb", sits, np.eye(3)).reshape(len(records), 3, -1)
    yield LengthError("seating of the gauges", standard.seating_mm * seated)
    turned = np.cross(np.eye(3), records.placement.deviations[:, None]).swapaxes(1, 2)
    yield LengthError("alignment of the gauges", noise.alignment * turned)
    second = records.seats[:, None, None] == 1
    yield LengthError("alignment of the gauges", standard.parallel * np.where(second, turned, 0.0))
