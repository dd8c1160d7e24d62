"""The table of parameters: one kind of row for the terminal, the screen, the report and the certificate.

All geometries are in the mechanism's frame convention, so that a choice of frames is no change.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING

from hexacell.cell.model import CellSettings
from hexacell.checks.check_result import ParameterChange
from hexacell.identification.diagnostics.tolerance_check import SIGNIFICANT_SIGMAS
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterSet, ParameterUnit
from hexacell.kinematics.rotations import Array
from hexacell.results.run_comparison import ParameterDifference
from hexacell.uncertainty.statement import COVERAGE_FACTOR

if TYPE_CHECKING:
    from procedures.run.state import RunState


SMALLEST_SIGMA = 0.002
"""Where most figures in mm or mrad are known better than this, five decimals are shown of all."""


@dataclass(frozen=True, slots=True)
class ParameterRow:
    """A parameter, its change and one standard deviation of that, in its unit.

    Attributes:
        old, new: its values; None in a check, which finds the change alone.
        doubt: why the change is no result; empty if it is one.
        decimals: of the figures shown.
    """

    name: str
    unit: ParameterUnit
    change: float
    sigma: float
    old: float | None = None
    new: float | None = None
    doubt: str = ""
    decimals: int = 3

    @property
    def expanded(self) -> float:
        """Expanded uncertainty of the change."""
        return COVERAGE_FACTOR * self.sigma

    @property
    def meaning(self) -> str:
        """Whether the change is more than chance, in words."""
        times = abs(self.change) / self.sigma
        if self.doubt:
            return self.doubt
        word = "unchanged" if times < SIGNIFICANT_SIGMAS else "changed"
        return f"{word} ({times:.{1 if times < 99.95 else 0}f} sigma)"

    @property
    def label(self) -> str:
        """The name with the unit of the figures shown, where that is not mm: ``rail2a, mrad``."""
        return self.name if self.unit is ParameterUnit.MM else f"{self.name}, {self.unit.shown}"

    def figure(self, value: float | None, sign: str = "") -> str:
        """A value in the unit shown, mm or mrad; empty for None."""
        return "" if value is None else f"{value / self.unit.like_a_mm:{sign}.{self.decimals}f}"


def parameter_rows(
    parameters: ParameterSet,
    old: Array,
    new: Array,
    sigma: Array,
    *,
    undetermined: Collection[str] = (),
    held: Collection[str] = (),
) -> tuple[ParameterRow, ...]:
    """A row for each parameter that the frame convention leaves free.

    ``undetermined`` are those that the records do not determine, ``held`` those that were not identified.
    """
    doubts = dict.fromkeys(undetermined, "not determined") | dict.fromkeys(held, "not identified")
    return _with_decimals(
        ParameterRow(
            one.name,
            one.kind.unit,
            change=float(new[row] - old[row]),
            sigma=float(sigma[row]),
            old=float(old[row]),
            new=float(new[row]),
            doubt=doubts.get(one.name, ""),
        )
        for row, one in enumerate(parameters.parameters)
        if sigma[row] > 0.0
    )


def _with_decimals(rows: Iterable[ParameterRow]) -> tuple[ParameterRow, ...]:
    """Rows with as many decimals as most of them are worth."""
    every = tuple(rows)
    if every and median(one.sigma / one.unit.like_a_mm for one in every) < SMALLEST_SIGMA:
        return tuple(replace(one, decimals=5) for one in every)
    return every


def rows_of_run(state: RunState, settings: CellSettings | None) -> tuple[ParameterRow, ...]:
    """What a run identified, or what a check found to have changed; empty where nothing is known yet."""
    if state.judged is not None and state.judged.check is not None:
        return rows_of_changes(state.judged.check.changes)
    if state.identified is None or state.started is None or settings is None:
        return ()
    parameters, result = settings.mechanism.parameters, state.identified.result
    before = settings.mechanism.normalize_frames(Geometry.of(parameters, state.started.controller))[0]
    return parameter_rows(
        parameters,
        before.vector,
        parameters.vector(result.geometry),
        parameters.vector(result.sigma),
        undetermined=frozenset(result.undetermined),
    )


def rows_of_changes(changes: Sequence[ParameterChange | ParameterDifference]) -> tuple[ParameterRow, ...]:
    """The changes that a check found, or those from one run to another."""
    return _with_decimals(
        ParameterRow(
            one.name,
            ParameterUnit(one.unit),
            one.change,
            one.sigma,
            old=getattr(one, "before", None),
            new=getattr(one, "after", None),
        )
        for one in changes
    )


def parameter_table(rows: Sequence[ParameterRow], old: str = "old", new: str = "new") -> tuple[str, ...]:
    """A header and a line for each parameter, in at most 80 columns."""
    width = max([6, *(len(one.label) + 1 for one in rows)])
    lines = [f"{'':{width}}{old:>12}{new:>12}{'change':>10}{'sigma':>9}"]
    for one in rows:
        values = f"{one.figure(one.old):>12}{one.figure(one.new):>12}"
        sizes = f"{one.figure(one.change, '+'):>10}{one.figure(one.sigma):>9}"
        lines.append(f"{one.label:{width}}{values}{sizes}  {one.meaning}")
    return tuple(lines)
