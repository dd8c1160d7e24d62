"""Measurements: records of joint variables and of the deviation of the ball from a reference."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import UsageError
from hexacell.kinematics.parameters import CONSTRAINTS
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array

Scalar = TypeVar("Scalar", bound=np.generic)
Joints = tuple[float, ...]
"""A number for each driven joint."""

Deviation = tuple[float, float, float]
Directions = tuple[int, ...]
"""Whether each joint last moved up, 1, or down, -1; 0 where that is not known."""

Temperatures = tuple[float | None, ...]
"""Temperatures of legs 1 to 6 and of the base, deg C; None if not known, as of legs that a machine lacks;
empty where nothing is."""

MEASURED_PARTS = 7

RecordId = tuple[int, int]
"""Point and orientation of a record, as the user counts them."""


def joints_of(values: Array) -> Joints:
    """Joint variables (J,), mm, as numbers."""
    return tuple(float(value) for value in values)


def deviation_of(values: Array) -> Deviation:
    """Values (3,), mm, along base x, y, z as numbers."""
    x, y, z = (float(value) for value in values)
    return x, y, z


@dataclass(frozen=True, slots=True)
class Record:
    """One settled measurement.

    Attributes:
        point: at which of the cell's points the gauges are placed, from 1.
        orientation: the pose at this point, from 1.
        pose: as commanded, under the geometry in the controller at that time.
        joints: joint variables q1, q2, ... from the encoders, mm or deg.
        deviation: of the ball from its position when the gauges were zeroed, along base x, y, z, mm.
        directions: from which side each joint arrived; empty where nothing is known of that.
        temperatures: of legs and base.
        time_s: when it was read, s from any moment that all records of its point share; None if not known.
    """

    point: int
    orientation: int
    pose: Pose
    joints: Joints
    deviation: Deviation
    directions: Directions = ()
    temperatures: Temperatures = ()
    time_s: float | None = None

    @property
    def id(self) -> RecordId:
        """Point and orientation."""
        return self.point, self.orientation


@dataclass(frozen=True)
class MeasurementSet:
    """Records in the order of measurement, and as arrays of n rows, which are read-only.

    Deviations are comparable within one point only. Its reference, at which the gauges were zeroed, is
    its first record.

    Raises:
        UsageError: two records have the same point and orientation.
    """

    records: tuple[Record, ...]

    def __post_init__(self) -> None:
        twice = [record for record, count in Counter(self._ids).items() if count > 1]
        if twice:
            point, orientation = twice[0]
            raise UsageError(f"there are two records of point {point}, orientation {orientation}")

    def __len__(self) -> int:
        return len(self.records)

    def subset(self, rows: NDArray[np.intp]) -> "MeasurementSet":
        """The records in some rows."""
        return MeasurementSet(tuple(self.records[row] for row in rows.tolist()))

    @property
    def _ids(self) -> Iterator[RecordId]:
        return (record.id for record in self.records)

    @cached_property
    def labels(self) -> NDArray[np.int_]:
        """Point and orientation (n, 2) of each record, counted from 1."""
        return _frozen(np.array([*self._ids], dtype=np.int_).reshape(-1, 2))

    @property
    def points(self) -> NDArray[np.int_]:
        """The point (n,) of each record, counted from 1."""
        return self.labels[:, 0]

    @cached_property
    def counts(self) -> Mapping[int, int]:
        """How many records each point has that has any."""
        return Counter(self.points.tolist())

    @cached_property
    def group(self) -> NDArray[np.intp]:
        """The point (n,) of each record, numbered 0 to m-1 in the order of first appearance."""
        places = {point: place for place, point in enumerate(self.counts)}
        return _frozen(np.array([places[record.point] for record in self.records], dtype=np.intp))

    @cached_property
    def poses(self) -> PoseBatch:
        """The commanded poses."""
        poses = PoseBatch.of(record.pose for record in self.records)
        return PoseBatch(_frozen(poses.positions), _frozen(poses.rotations))

    @cached_property
    def joints(self) -> Array:
        """Joint variables (n, J), in their unit."""
        return _frozen(
            np.array([record.joints for record in self.records], dtype=float).reshape(self._shape)
        )

    @cached_property
    def deviations(self) -> Array:
        """Deviations (n, 3) from the point's reference, mm."""
        return _frozen(np.array([record.deviation for record in self.records], dtype=float).reshape(-1, 3))

    @cached_property
    def directions(self) -> Array:
        """From which side each joint arrived (n, J): 1 from below, -1 from above, 0 where not known."""
        rows = [record.directions or (0,) * len(record.joints) for record in self.records]
        return _frozen(np.array(rows, dtype=float).reshape(self._shape))

    @property
    def _shape(self) -> tuple[int, int]:
        """How many records there are, and of how many joints."""
        return len(self.records), len(self.records[0].joints) if self.records else CONSTRAINTS

    @cached_property
    def temperatures(self) -> Array:
        """The temperatures of legs and base (n, 7), deg C; NaN where one is not known."""
        return _frozen(temperatures_of(record.temperatures for record in self.records))

    @cached_property
    def times_s(self) -> Array:
        """When each record (n,) was read, s; NaN where that is not known."""
        return _frozen(np.array([record.time_s for record in self.records], dtype=float))


def temperatures_of(rows: Iterable[Temperatures]) -> Array:
    """Temperatures of legs and base as an array (n, 7), deg C; NaN where one is not known."""
    known = [[*row, *[None] * MEASURED_PARTS][:MEASURED_PARTS] for row in rows]
    return np.array(known, dtype=float).reshape(-1, MEASURED_PARTS)


def _frozen(array: NDArray[Scalar]) -> NDArray[Scalar]:
    array.setflags(write=False)
    return array
