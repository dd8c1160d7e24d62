"""Pilot records, which steer the choice of poses while little is known of the robot, and nothing else.

At the first point poses are chosen nearly blindly: only small rotations surely keep the ball inside the
gauges' travel, and they are little informative. To measure the noise the robot leaves the first reference
several times anyway, and comes back. When it leaves it for chosen poses, and the gauges are read there, the
records that follow are nearly as informative as if the robot were known. That a design for a nonlinear
model begins with some runs that only make it possible is usual (Box & Hunter, Sequential Design of
Experiments for Nonlinear Models, 1965).

Estimates while measuring use pilot records as others. The identification uses no pilot records: they are
from before the noise is measured, and from before it is decided of how many windows a record is the mean.
"""

from collections.abc import Sequence

from hexacell.cell.measuring import MOST_POSES
from hexacell.identification.problem.problem import Problem
from hexacell.kinematics.rotations import Mask
from hexacell.measurements.records import MeasurementSet, Record

FIRST_PILOT = MOST_POSES + 1
"""Orientation number of the first pilot pose, which no record has."""

FIRST_REPEAT = 2 * MOST_POSES + 1
"""Orientation number of the first reading of a reference that counts as a record, as the gauges drift."""

CAUTION = 3.0
"""Factor by which the noise may exceed what is stated while pilot poses are chosen."""

PER_DEPARTURE, MOST_PILOTS = 3, 6
"""Pilot poses before the robot comes back to the reference, and in all."""

PER_DEPARTURE_TO_A_LIST, MOST_TO_A_LIST = 4, 24
"""Where a file lists the poses to measure, more must be known before the first of them is safe."""


def pilots_per_departure(is_listed: bool) -> int:
    """At how many pilot poses the gauges are read before the robot comes back to the reference."""
    return PER_DEPARTURE_TO_A_LIST if is_listed else PER_DEPARTURE


def pilot_number(orientation: int) -> int | None:
    """The number, from 1, of the pilot pose that an orientation means; None for another pose."""
    return orientation - MOST_POSES if orientation >= FIRST_PILOT else None


def with_pilots(measurements: MeasurementSet, pilots: Sequence[Record]) -> MeasurementSet:
    """Records and pilot records in the order of measurement: these follow the reference of their point."""
    ids = [record.id for record in measurements.records]
    if not pilots or (pilots[0].point, 1) not in ids:
        return measurements
    first = ids.index((pilots[0].point, 1)) + 1
    return MeasurementSet((*measurements.records[:first], *pilots, *measurements.records[first:]))


def are_counted(problem: Problem) -> Mask:
    """Which of a problem's records (n,) are no pilot records."""
    return problem.labels[:, 1] < FIRST_PILOT
