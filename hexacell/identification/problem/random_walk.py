"""Errors of records whose zero drifts: a random walk from one record of a point to the next.

The gauges' mounts, the frame and temperature move the zero of the gauges by ``d_k ~ N(0, s^2 I)`` from
record k - 1 to record k of a point, so that record k is off by ``d_1 + ... + d_k``. With the increments as
unknowns that have this prior, records have exactly the covariance ``s^2 min(j, k) I`` of a random walk. A
reading of the reference is a record as any other. Where one begins and one ends the records of a point,
what remains between them is a Brownian bridge about the straight line from one to the other. Where the
times of all records are known, an increment is by the time that has passed: after a pause it is larger.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, appendix B.2.1.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.rotations import Array


class GaugeWalk(NamedTuple):
    """How the gauges' zero drifts.

    Attributes:
        step_mm: one standard deviation along each axis from one reading at a point to the next; zero unless
            the references that were read again show it.
        interval_s: the mean time from one to the next, by which it goes; zero: it goes by their number.
    """

    step_mm: float = 0.0
    interval_s: float = 0.0


NO_WALK = GaugeWalk()
TRIAL = 4
"""Steps from a reference to its next record: in between the gauges are tried by three readings."""


def walk_columns(
    first_rows: NDArray[np.intp], records: int, walk: GaugeWalk, times_s: Array | None = None
) -> Array:
    """What one standard deviation of each increment does to each of n records (n, 3, 3 (n - m)), mm.

    Each of m points begins at one of ``first_rows`` (m,), its records in the order in which they were taken
    at ``times_s`` (n,). Without these, or where one is NaN, steps are counted.
    """
    rows = np.arange(records)
    later = np.setdiff1d(rows, first_rows)
    point = np.searchsorted(first_rows, rows, side="right")
    is_moved = (point[:, None] == point[later]) & (rows[:, None] >= later)
    steps = np.where(np.isin(later - 1, first_rows), TRIAL, 1.0)
    if walk.interval_s and times_s is not None and np.isfinite(times_s).all():
        steps = np.maximum(times_s[later] - times_s[later - 1], 0.0) / walk.interval_s
    columns: Array = (walk.step_mm * np.sqrt(steps) * is_moved)[:, None, :, None] * np.eye(3)[:, None, :]
    return columns.reshape(records, 3, 3 * len(later))
