"""A cell at a glance: what its latest runs said, what its controller has, what waits for a person."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.runs.cell_lock import lock_holder
from hexacell.services.history.drift_history import DriftHistory, drift_history
from hexacell.services.history.history import PastRun, past_runs
from hexacell.services.history.run_index import RunIndex
from hexacell.verdict.decision import Verdict

CLOCKS_DIFFER = timedelta(minutes=5)
"""By so much the clocks of computers that share a folder may."""


@dataclass(frozen=True, slots=True)
class CellStatus:
    """The state of one cell.

    Attributes:
        in_use_by: who holds its lock, in words; none if nobody does.
        latest: the run that ended last, and ``judged`` the last one with a verdict.
        passed_at: when a run passed last.
        in_force: the run whose config the controller has; none where it was never calibrated, or edited.
        due_at: when the next calibration is due, where the cell file says how long one is valid.
        proposal: the newest run whose proposal waits for a person.
        drift: the watch over all runs.
    """

    cell: Cell
    in_use_by: str | None
    latest: PastRun | None
    judged: PastRun | None
    passed_at: datetime | None
    in_force: PastRun | None
    due_at: datetime | None
    proposal: PastRun | None
    drift: DriftHistory

    @property
    def ends_in_future(self) -> PastRun | None:
        """The latest run, if by the clock of today it has not ended yet: it hides those that follow."""
        ended = None if self.latest is None else self.latest.summary.ended
        return self.latest if ended is not None and ended > datetime.now(UTC) + CLOCKS_DIFFER else None

    @property
    def worst_share(self) -> tuple[str, float] | None:
        """The parameter whose cumulative sum is nearest to its limit, and how near; none without runs."""
        return max(self.drift.shares, key=lambda one: one[1], default=None)

    @property
    def surest_drift(self) -> tuple[str, float] | None:
        """The parameter that drifts most surely, and by how many standard deviations; none without runs."""
        scores = [(one.name, abs(one.per_day) / one.sigma_per_day) for one in self.drift.rates]
        return max(scores, key=lambda one: one[1], default=None)


@dataclass(frozen=True, slots=True)
class UnreadableCell:
    """A cell of which nothing can be said, as its file, or that of its controller, cannot be used."""

    path: Path
    error: HexacellError


def cell_status(cell: Cell) -> CellStatus:
    """Of one cell, from its run folders.

    Raises:
        FileError: the controller's config, or the folder of the runs, cannot be read.
    """
    index = RunIndex(cell)
    runs = [run for run in past_runs(cell, index) if run.summary.ended is not None]
    in_force = next((run for run in runs if run.is_in_controller), None)
    return CellStatus(
        cell=cell,
        in_use_by=lock_holder(cell.config_path),
        latest=next(iter(runs), None),
        judged=next((run for run in runs if run.summary.verdict is not None), None),
        passed_at=next((run.summary.ended for run in runs if run.summary.verdict is Verdict.PASS), None),
        in_force=in_force,
        due_at=next_calibration_due(cell, in_force),
        proposal=next((run for run in runs if run.summary.has_proposal), None),
        drift=drift_history(cell, index),
    )


def next_calibration_due(cell: Cell, in_force: PastRun | None) -> datetime | None:
    """When the geometry that the controller has, from this run, is no longer valid; none if not stated."""
    valid_days = cell.settings.acceptance.valid_days
    if in_force is None or in_force.summary.ended is None or valid_days is None:
        return None
    return in_force.summary.ended + timedelta(days=valid_days)
