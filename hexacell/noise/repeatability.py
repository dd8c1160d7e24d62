"""Repeatability: the scatter of deviations where the same pose was commanded more than once.

It needs no geometry: all visits of a commanded pose at a point have the same deviation, except for the
scatter of the machine, which no calibration can remove.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet

COMMAND_DIGITS = 6
"""Decimal digits, mm and deg, to which commands are compared."""
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Repeatability:
    """Scatter of the deviations over visits of the same pose.

    Attributes:
        per_axis_mm: pooled standard deviations along x, y and z.
        degrees_of_freedom: of each of them: visits minus poses.
        poses: the number of poses visited more than once.
    """

    per_axis_mm: tuple[float, float, float]
    degrees_of_freedom: int
    poses: int

    @property
    def distance_mm(self) -> float:
        """Root mean square distance of a visit from the mean of its pose."""
        return float(np.linalg.norm(self.per_axis_mm))

    @property
    def at_least_mm(self) -> float:
        """Lower limit of the distance, with 95 % confidence."""
        freedom = 3 * self.degrees_of_freedom
        return self.distance_mm * float(np.sqrt(freedom / chi_square_limit(freedom, 1.0 - CONFIDENCE)))

    def dominates(self, error_mm: float) -> bool:
        """Whether an error (root mean square distance, mm) is significantly smaller than the scatter."""
        return self.at_least_mm > error_mm


def repeatability(
    measurements: MeasurementSet, left_out: Collection[tuple[int, int]] = ()
) -> Repeatability | None:
    """The repeatability in a measurement set; None if no pose was visited twice.

    ``left_out`` are the point and orientation of each record known to be wrong.
    """
    groups = [rows for rows in _visits(measurements, left_out) if len(rows) > 1]
    freedom = sum(len(rows) - 1 for rows in groups)
    if not freedom:
        return None
    squares = sum(_sum_of_squares(measurements.deviations[rows]) for rows in groups)
    x, y, z = np.sqrt(squares / freedom)
    return Repeatability((float(x), float(y), float(z)), freedom, len(groups))


def _visits(measurements: MeasurementSet, left_out: Collection[tuple[int, int]]) -> Iterable[list[int]]:
    """Rows of each pose commanded at each point."""
    visits: defaultdict[tuple[float, ...], list[int]] = defaultdict(list)
    for row, record in enumerate(measurements.records):
        if record.id not in left_out:
            command = (round(value, COMMAND_DIGITS) for value in record.pose.as_tuple())
            visits[record.point, *command].append(row)
    return visits.values()


def _sum_of_squares(deviations: Array) -> Array:
    squares: Array = np.sum((deviations - deviations.mean(axis=0)) ** 2, axis=0)
    return squares
