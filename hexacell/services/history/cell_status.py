"""Cells at a glance: what the latest runs said, what the controller has, what waits for a person.

Each cell that shares an archive puts this there, and any computer can read of all.
"""

import socket
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import TypeVar

from pydantic import ValidationError

from hexacell.cell.fields import Frozen, Name, Shown, Text
from hexacell.cell.loader import Cell
from hexacell.runs.cell_lock import lock_holder
from hexacell.runs.run_folder import DocumentKind, StampedDocument, runs_folder
from hexacell.services.history.drift_history import DriftHistory, drift_history
from hexacell.services.history.past_runs import past_runs
from hexacell.services.history.run_index import PastRun, RunIndex, RunSummary
from hexacell.verdict.decision import Verdict

CLOCKS_DIFFER = timedelta(minutes=5)
"""Largest difference of the clocks of computers that share a folder."""

Model = TypeVar("Model", bound=Frozen)


class FleetCell(Frozen):
    """How a cell is (UTC), in figures; its archive has those of when it last put them there.

    ``latest_run``, ``latest_at`` and ``mode`` are of the run that ended last, ``verdict`` to ``judged_at``
    of the last one with a verdict. ``cell`` is its file on ``host``, ``changes`` how many the watch found.
    """

    name: Name
    host: Shown
    cell: Shown
    seen_at: datetime
    latest_run: Shown | None = None
    latest_at: datetime | None = None
    mode: Text = ""
    verdict: Verdict | None = None
    position_mm: float | None = None
    expanded_mm: float | None = None
    judged_at: datetime | None = None
    passed_at: datetime | None = None
    due_at: datetime | None = None
    proposal: Shown | None = None
    changes: int = 0

    @property
    def is_overdue(self) -> bool:
        """Whether its calibration is overdue, by this computer's clock."""
        return self.due_at is not None and self.due_at <= datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class CellStatus:
    """The state of one cell.

    Attributes:
        in_use_by: who holds its lock, in words; None if nobody does.
        latest: the run that ended last, and ``judged`` the last one with a verdict.
        in_force: the run whose config the controller has; None where it was never calibrated, or edited.
        proposal: the newest run whose proposal waits for a person.
        figures: the same for others who share its archive.
    """

    cell: Cell
    in_use_by: str | None
    latest: PastRun | None
    judged: PastRun | None
    in_force: PastRun | None
    proposal: PastRun | None
    drift: DriftHistory
    figures: FleetCell

    @property
    def ends_in_future(self) -> PastRun | None:
        """The latest run, if by the clock of today it has not ended yet: it hides those that follow."""
        ended = None if self.latest is None else self.latest.summary.ended
        return self.latest if ended is not None and ended > datetime.now(UTC) + CLOCKS_DIFFER else None

    @property
    def worst_share(self) -> tuple[str, float] | None:
        """The parameter whose cumulative sum is nearest to its limit, and how near; None without runs."""
        return max(self.drift.shares, key=lambda one: one[1], default=None)


def cell_status(cell: Cell) -> CellStatus:
    """The status of a cell, from its run folders; raises as :func:`.past_runs`."""
    index = RunIndex(cell)
    runs = [run for run in past_runs(cell, index) if run.summary.ended is not None]
    latest = next(iter(runs), None)
    judged = next((run for run in runs if run.summary.verdict is not None), None)
    in_force = next((run for run in runs if run.is_in_controller), None)
    proposal = next((run for run in runs if run.summary.has_proposal), None)
    drift, position = drift_history(cell, index), summary_of(judged).position
    figures = FleetCell(
        name=cell.settings.name,
        host=socket.gethostname(),
        cell=str(cell.path.absolute()),
        seen_at=datetime.now(UTC),
        latest_run=latest and latest.name,
        latest_at=summary_of(latest).ended,
        mode=summary_of(latest).mode,
        verdict=summary_of(judged).verdict,
        position_mm=position and position.value,
        expanded_mm=position and position.expanded,
        judged_at=summary_of(judged).ended,
        passed_at=next((run.summary.ended for run in runs if run.summary.verdict is Verdict.PASS), None),
        due_at=next_calibration_due(cell, in_force),
        proposal=proposal and proposal.name,
        changes=len(drift.changes),
    )
    in_use_by = lock_holder(cell.config_path)
    return CellStatus(cell, in_use_by, latest, judged, in_force, proposal, drift, figures)


def next_calibration_due(cell: Cell, in_force: PastRun | None) -> datetime | None:
    """When the geometry that the controller has is no longer valid; None where that is not known."""
    valid_days = cell.settings.acceptance.valid_days
    ended = in_force and in_force.summary.ended
    return ended + timedelta(days=valid_days) if ended and valid_days is not None else None


@dataclass(frozen=True, slots=True)
class FleetRun:
    """One run of one of the cells; ``host`` is the computer it was run from."""

    cell: str
    host: str
    name: str
    summary: RunSummary


def publish_status(status: CellStatus) -> None:
    """Put the status of a cell into the archive that it shares, if any; raises ``ArchiveUnavailable``."""
    cell = status.cell
    if cell.settings.archive.url is None:
        return
    from hexacell.runs.archive import Archive  # noqa: PLC0415 - SQLAlchemy only where it is used

    # The document is of the cell itself, and so has no run's name.
    document = StampedDocument("", status.figures.model_dump_json().encode())
    with closing(Archive(runs_folder(cell), cell.settings.name, cell.settings.archive.url)) as archive:
        archive.store(DocumentKind.CELL, {"": document})


def summary_of(run: PastRun | None) -> RunSummary:
    """What a run was; without one, that nothing is known."""
    return RunSummary() if run is None else run.summary


def fleet_cells(url: str) -> tuple[FleetCell, ...]:
    """All cells of an archive, by name; raises ``ArchiveUnavailable``."""
    return tuple(cell for _, cell in _shared(url, DocumentKind.CELL, FleetCell))


def fleet_runs(url: str) -> tuple[FleetRun, ...]:
    """The runs of all cells of an archive, the newest first; raises ``ArchiveUnavailable``."""
    found = [
        FleetRun(cell, place.partition(":")[0], run, summary)
        for (cell, place, run), summary in _shared(url, DocumentKind.SUMMARY, RunSummary)
    ]
    never = datetime.min.replace(tzinfo=UTC)
    return tuple(
        sorted(found, key=lambda run: (run.summary.ended or never, run.cell, run.name), reverse=True)
    )


def _shared(
    url: str, kind: DocumentKind, model: type[Model]
) -> Iterator[tuple[tuple[str, str, str], Model]]:
    """What cells share, of which cell, place and run; without what a newer program has written."""
    from hexacell.runs.archive import shared_documents  # noqa: PLC0415 - SQLAlchemy only where used

    for cell, place, run, content in shared_documents(url, kind):
        with suppress(ValidationError):
            yield (cell, place, run), model.model_validate_json(content)
