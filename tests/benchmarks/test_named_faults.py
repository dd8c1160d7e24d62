"""Mistakes of people and devices in the records of good and of imperfect machines: are they named?

Gross errors, slips, swaps, signs and inches are far larger than what a machine does, and each has one right
name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import DataFault, DataFaultKind, GaugeFaultError
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record, RecordId, deviation_of
from tests.benchmarks.figures import at_least, least_by_chance
from tests.benchmarks.machines import on_all_cores
from tests.benchmarks.samples import sample
from tests.benchmarks.worlds.campaigns import Setting
from tests.benchmarks.worlds.kinds import NONE, ORDINARY, PRECISION
from tests.benchmarks.worlds.trials import Trial, settings, world_of

RUNS = sample(__name__, "RUNS")
MACHINES = 6
"""Of each kind, for one run."""

NAMED_SHARES = {NONE: 0.98, PRECISION: 0.97, ORDINARY: 0.92}
"""What a machine's own errors hide beside its records is left."""

MM_PER_INCH = 25.4
Change = Callable[[Array], Array]
Spoiled = tuple[MeasurementSet, frozenset[RecordId]]
"""Records with a mistake, and those of them that are to be left out; none if all are refused."""


@dataclass(frozen=True)
class Mistake:
    """One kind of mistake, and what it may rightly be called."""

    name: str
    make: Callable[[MeasurementSet, np.random.Generator], Spoiled]
    faults: frozenset[DataFaultKind]

    def is_named_by(self, faults: Collection[DataFault], concerned: frozenset[RecordId]) -> bool:
        """Whether these faults are the mistake and nothing else."""
        left_out = {record for fault in faults for record in fault.left_out}
        return bool(faults) and left_out == concerned and all(fault.kind in self.faults for fault in faults)


def _changed(measured: MeasurementSet, rows: Collection[int], change: Change) -> MeasurementSet:
    records = list(measured.records)
    for row in rows:
        deviation = deviation_of(change(np.array(records[row].deviation)))
        records[row] = replace(records[row], deviation=deviation)
    return MeasurementSet(tuple(records))


def one_reading(mm: float) -> Mistake:
    """A gauge of one record shows too much."""

    def make(measured: MeasurementSet, random: np.random.Generator) -> Spoiled:
        wrong, gauge = int(random.integers(len(measured))), np.eye(3)[random.integers(3)]
        off = mm * random.choice([-1.0, 1.0]) * gauge
        return _changed(measured, [wrong], lambda d: d + off), frozenset({measured.records[wrong].id})

    return Mistake(f"one reading off by {mm:g} mm", make, frozenset({DataFaultKind.GROSS_ERROR}))


def exchanged_joints(measured: MeasurementSet, random: np.random.Generator) -> Spoiled:
    """The joint variables of two records are in each other's place."""
    records = list(measured.records)
    first = int(random.integers(1, len(records) - 1))
    one, other = records[first], records[first + 1]
    records[first], records[first + 1] = (
        replace(one, joints=other.joints),
        replace(other, joints=one.joints),
    )
    return MeasurementSet(tuple(records)), frozenset({one.id, other.id})


def slip(mm: float) -> Mistake:
    """The zero of a gauge slips in the middle of a point."""

    def make(measured: MeasurementSet, random: np.random.Generator) -> Spoiled:
        point, first = int(random.integers(1, 6)), int(random.integers(4, 9))
        gauge = mm * np.eye(3)[random.integers(3)]

        def is_after(record: Record) -> bool:
            return record.point == point and record.orientation >= first

        rows = [row for row, record in enumerate(measured.records) if is_after(record)]
        after = frozenset(measured.records[row].id for row in rows)
        return _changed(measured, rows, lambda d: d + gauge), after

    return Mistake(f"the zero slips by {mm:g} mm", make, frozenset({DataFaultKind.ZERO_SHIFT}))


def misread(name: str, kind: DataFaultKind, change: Change, *, everywhere: bool) -> Mistake:
    """Gauges that are read wrongly at one point, or at all."""

    def make(measured: MeasurementSet, random: np.random.Generator) -> Spoiled:
        point = int(random.integers(1, 6))
        rows = [n for n, record in enumerate(measured.records) if everywhere or record.point == point]
        return _changed(measured, rows, change), frozenset()

    return Mistake(f"{name} {'everywhere' if everywhere else 'at a point'}", make, frozenset({kind}))


MISTAKES = [
    *map(one_reading, (0.3, 0.5, 1.0, 3.0)),
    *map(slip, (0.3, 0.5, 1.5)),
    Mistake(
        "joint variables of two records exchanged",
        exchanged_joints,
        frozenset({DataFaultKind.MISMATCHED_JOINTS, DataFaultKind.GROSS_ERROR, DataFaultKind.SINGULAR}),
    ),
    *(
        misread(name, kind, change, everywhere=everywhere)
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


def named(own: Setting, measured: MeasurementSet) -> tuple[DataFault, ...]:
    try:
        return identify(own.robot.problem(measured)).data_faults
    except GaugeFaultError as refused:
        return (refused.fault,)


def is_named(kind: str, job: tuple[int, int]) -> bool:
    """One of the mistakes, by its place among them, in the records of a machine."""
    mistake, number = MISTAKES[job[0]], job[1]
    world, own = world_of(Trial(kind, 1.0, number))
    measured = world.records(own.commands, own.robot.commanding)
    random = np.random.default_rng([29, number, *mistake.name.encode()])
    wrong, concerned = mistake.make(measured, random)
    return mistake.is_named_by(named(own, wrong), concerned)


@pytest.mark.parametrize(("kind", "least"), NAMED_SHARES.items())
def test_mistakes_are_named(figure, kind, least):
    settings()  # before the processes are forked, so that they share them
    count = MACHINES * RUNS
    jobs = [(place, number) for place in range(len(MISTAKES)) for number in range(count)]
    every = on_all_cores(partial(is_named, kind), jobs, together=count)
    for place, mistake in enumerate(MISTAKES):
        results = every[place * count : (place + 1) * count]
        figure(f"{mistake.name}, {kind}: named", sum(results), f"of {len(results)}")
    target = at_least(least_by_chance(least, len(every)))
    figure(f"all mistakes, {kind}: named", sum(every), f"of {len(every)}", target)
