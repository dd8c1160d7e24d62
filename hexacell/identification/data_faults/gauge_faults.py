"""The gauge faults: gauges exchanged, reversed or reading in inches.

Each is a known matrix T: the readings were d and should have been T d.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.identification.solver.result import GAUGES, DataFaultKind
from hexacell.kinematics.rotations import Array

MM_PER_INCH = 25.4


@dataclass(frozen=True, slots=True, eq=False)
class GaugeFault:
    """A known fault of gauges; ``remedy`` (3, 3) turns false readings x, y, z into true ones."""

    kind: DataFaultKind
    gauges: str
    remedy: Array


def _gauge_faults() -> Iterator[GaugeFault]:
    for first, second in ((0, 1), (0, 2), (1, 2)):
        order = [0, 1, 2]
        order[first], order[second] = second, first
        yield GaugeFault(DataFaultKind.EXCHANGED, GAUGES[first] + GAUGES[second], np.eye(3)[order])
    for order in ([1, 2, 0], [2, 0, 1]):
        yield GaugeFault(DataFaultKind.EXCHANGED, GAUGES, np.eye(3)[order])
    for kind, factor in ((DataFaultKind.REVERSED, -1.0), (DataFaultKind.INCHES, MM_PER_INCH)):
        for axis, gauge in enumerate(GAUGES):
            yield GaugeFault(kind, gauge, np.diag(np.where(np.arange(3) == axis, factor, 1.0)))
        yield GaugeFault(kind, GAUGES, factor * np.eye(3))


GAUGE_FAULTS = tuple(_gauge_faults())
