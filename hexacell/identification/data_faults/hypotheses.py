"""Hypotheses on what is wrong with some records, and what the records are without it.

There are three kinds. A gross error concerns single records, which disagree with all the others. When the
zero of the gauges shifts, all later records of the point are off by one constant. A gauge fault (gauges
exchanged, reversed or reading in inches) is a known matrix T: the readings were d and should have been T
d.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.result import GAUGES, DataFaultKind
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import RecordId

PENALTY_PER_UNKNOWN = 10.0
"""How much a hypothesis must lower the chi-square for each number that it is free to choose."""

MM_PER_INCH = 25.4

SPLIT_POINT = -1
"""Label of the point that the records after a zero shift form while it is tested."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultHypothesis(ABC):
    """One explanation of records that disagree with the others; equal however it was found.

    Attributes:
        gain: the decrease of the chi-square if it is true, to first order.
    """

    gain: float = field(compare=False)
    unknowns: int = field(compare=False)

    @property
    def cost(self) -> float:
        """The penalized gain, negative: the most likely hypothesis has the lowest cost."""
        return PENALTY_PER_UNKNOWN * self.unknowns - self.gain

    @abstractmethod
    def corrected(self, problem: Problem) -> Problem:
        """The problem without the fault: readings corrected, or records left out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutlierHypothesis(FaultHypothesis):
    """Gross errors: these records disagree with all the others and are left out."""

    records: tuple[RecordId, ...]

    def only(self, records: Collection[RecordId]) -> OutlierHypothesis:
        """The gross errors of some of the records alone."""
        return replace(self, records=tuple(record for record in self.records if record in records))

    def corrected(self, problem: Problem) -> Problem:
        """The problem without these records."""
        return problem.subset(~problem.mask_of(self.records))


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroShiftHypothesis(FaultHypothesis):
    """The gauges' zero shifted right before a record; it and the later ones of the point are left out.

    Attributes:
        shift: (3,), mm, by which the gauges x, y and z read too much since then.
        significance: the gain over its critical value, by the scatter that the records have.
    """

    point: int
    orientation: int
    shift: Array = field(compare=False)
    significance: float = field(compare=False)

    def rows(self, problem: Problem) -> Mask:
        """The records (n,) after the shift."""
        first = np.flatnonzero(problem.mask_of([(self.point, self.orientation)]))[0]
        return np.asarray((problem.labels[:, 0] == self.point) & (np.arange(problem.records) >= first))

    def corrected(self, problem: Problem) -> Problem:
        """The problem without the records after the shift."""
        return problem.subset(~self.rows(problem))

    def split(self, problem: Problem) -> Problem:
        """The problem with the records after the shift as a point with an unknown zero of its own."""
        after = self.rows(problem)
        labels = problem.labels.copy()
        labels[after, 0] = SPLIT_POINT
        first_rows = np.union1d(problem.first_rows, np.flatnonzero(after)[:1])
        return replace(problem, labels=labels, first_rows=first_rows)


@dataclass(frozen=True, slots=True, eq=False)
class GaugeFault:
    """A known fault of gauges; ``remedy`` (3, 3) turns false readings x, y, z into true ones."""

    kind: DataFaultKind
    gauges: str
    remedy: Array

    def in_base_frame(self, problem: Problem) -> Array:
        """The remedy (3, 3) of deviations along the axes of the base frame."""
        return np.asarray(problem.gauges @ self.remedy @ problem.gauges.T)


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


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeFaultHypothesis(FaultHypothesis):
    """A gauge fault at one point, or at every point (``point`` is None)."""

    gauge_fault: GaugeFault
    point: int | None

    def corrected(self, problem: Problem) -> Problem:
        """The problem with true readings."""
        rows = np.ones(problem.records, bool) if self.point is None else problem.labels[:, 0] == self.point
        remedy = self.gauge_fault.in_base_frame(problem)
        deviations = np.where(rows[:, None], problem.deviations @ remedy.T, problem.deviations)
        return replace(problem, deviations=deviations)


ALL_IN_INCHES = GaugeFaultHypothesis(gain=0.0, unknowns=0, gauge_fault=GAUGE_FAULTS[-1], point=None)
