"""Mistakes of people and devices in the records of a world: gross errors, slips, swaps, signs and inches.

They are far larger than what a machine does, and each has one right name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.solver.result import DataFault, DataFaultKind
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record, RecordId, deviation_of, joints_of

Random = np.random.Generator
Change = Callable[[Array], Array]

MM_PER_INCH = 25.4


@dataclass(frozen=True)
class Mistake:
    """One kind of mistake.

    Attributes:
        make: the records with the mistake, and the records concerned; none if it is refused.
        faults: what it may rightly be called.
    """

    name: str
    make: Callable[[MeasurementSet, Random], tuple[MeasurementSet, frozenset[RecordId]]]
    faults: frozenset[DataFaultKind]

    def is_named_by(self, faults: Collection[DataFault], concerned: frozenset[RecordId]) -> bool:
        """Whether these faults are the mistake and nothing else."""
        left_out = {record for fault in faults for record in fault.left_out}
        return bool(faults) and left_out == concerned and all(fault.kind in self.faults for fault in faults)


GROSS = frozenset({DataFaultKind.GROSS_ERROR})
SHIFT = frozenset({DataFaultKind.ZERO_SHIFT})
JOINTS = frozenset({DataFaultKind.MISMATCHED_JOINTS, DataFaultKind.GROSS_ERROR, DataFaultKind.SINGULAR})


def one_reading(mm: float) -> Mistake:
    """A gauge of one record shows too much."""

    def make(measured: MeasurementSet, random: Random) -> tuple[MeasurementSet, frozenset[RecordId]]:
        wrong, gauge = int(random.integers(len(measured))), np.eye(3)[random.integers(3)]
        return _changed(
            measured, [wrong], lambda d: d + mm * random.choice([-1.0, 1.0]) * gauge
        ), frozenset({measured.records[wrong].id})

    return Mistake(f"one reading off by {mm:g} mm", make, GROSS)


def exchanged_joints(
    measured: MeasurementSet, random: Random
) -> tuple[MeasurementSet, frozenset[RecordId]]:
    """The joint variables of two records are in each other's place."""
    records = list(measured.records)
    first = int(random.integers(1, len(records) - 1))
    one, other = records[first], records[first + 1]
    records[first], records[first + 1] = (
        replace(one, joints=joints_of(np.array(other.joints))),
        replace(other, joints=joints_of(np.array(one.joints))),
    )
    return MeasurementSet(tuple(records)), frozenset({one.id, other.id})


def slip(mm: float) -> Mistake:
    """The zero of a gauge slips in the middle of a point."""

    def make(measured: MeasurementSet, random: Random) -> tuple[MeasurementSet, frozenset[RecordId]]:
        point, first = int(random.integers(1, 6)), int(random.integers(4, 9))
        gauge = mm * np.eye(3)[random.integers(3)]

        def is_after(record: Record) -> bool:
            return record.point == point and record.orientation >= first

        rows = [row for row, record in enumerate(measured.records) if is_after(record)]
        after = frozenset(record.id for record in measured.records if is_after(record))
        return _changed(measured, rows, lambda d: d + gauge), after

    return Mistake(f"the zero slips by {mm:g} mm", make, SHIFT)


def gauges(name: str, kind: DataFaultKind, change: Change, *, everywhere: bool) -> Mistake:
    """Gauges that are read wrongly at one point, or at all."""

    def make(measured: MeasurementSet, random: Random) -> tuple[MeasurementSet, frozenset[RecordId]]:
        point = int(random.integers(1, 6))
        rows = [n for n, record in enumerate(measured.records) if everywhere or record.point == point]
        return _changed(measured, rows, change), frozenset()

    return Mistake(f"{name} {'everywhere' if everywhere else 'at a point'}", make, frozenset({kind}))


def _changed(measured: MeasurementSet, rows: Collection[int], change: Change) -> MeasurementSet:
    records = list(measured.records)
    for row in rows:
        records[row] = replace(
            records[row], deviation=deviation_of(change(np.array(records[row].deviation)))
        )
    return MeasurementSet(tuple(records))


MISTAKES = [
    one_reading(0.3),
    one_reading(0.5),
    one_reading(1.0),
    one_reading(3.0),
    Mistake("joint variables of two records exchanged", exchanged_joints, JOINTS),
    slip(0.3),
    slip(0.5),
    slip(1.5),
    *(
        gauges(name, kind, change, everywhere=everywhere)
        for everywhere in (False, True)
        for name, kind, change in (
            ("x and y exchanged", DataFaultKind.EXCHANGED, lambda d: d[[1, 0, 2]]),
            ("all exchanged", DataFaultKind.EXCHANGED, lambda d: d[[2, 0, 1]]),
            ("z reversed", DataFaultKind.REVERSED, lambda d: d * [1.0, 1.0, -1.0]),
            ("all reversed", DataFaultKind.REVERSED, np.negative),
            ("y in inches", DataFaultKind.INCHES, lambda d: d / [1.0, MM_PER_INCH, 1.0]),
            ("all in inches", DataFaultKind.INCHES, lambda d: d / MM_PER_INCH),
        )
    ),
]
