"""Cells at a glance: what the latest runs said, what the controller has, what waits for a person.

Each cell that shares an archive puts this there, and any computer can read of all.
"""

from __future__ import annotations

import socket
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pydantic import ValidationError

from hexacell.cell.fields import Frozen, Name, Text
from hexacell.cell.loader import Cell
from hexacell.errors import HexacellError
from hexacell.runs.archived_documents import DocumentKind, StampedDocument
from hexacell.runs.cell_lock import lock_holder
from hexacell.runs.run_folder import runs_folder
from hexacell.services.history.drift_history import DriftHistory, drift_history
from hexacell.services.history.past_runs import past_runs
from hexacell.services.history.run_index import PastRun, RunIndex, RunSummary
from hexacell.verdict.decision import Verdict

if TYPE_CHECKING:
    from hexacell.runs.archive import SharedDocument

CLOCKS_DIFFER = timedelta(minutes=5)
"""Largest difference of the clocks of computers that share a folder."""

Model = TypeVar("Model", bound=Frozen)

OF_THE_CELL = ""
"""Stands for a run's name where a document is of the cell itself."""


@dataclass(frozen=True, slots=True)
class CellStatus:
    """The state of one cell.

    Attributes:
        in_use_by: who holds its lock, in words; None if nobody does.
        latest: the run that ended last, and ``judged`` the last one with a verdict.
        passed_at: when a run passed last.
        in_force: the run whose config the controller has; None where it was never calibrated, or edited.
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
        """The parameter whose cumulative sum is nearest to its limit, and how near; None without runs."""
        return max(self.drift.shares, key=lambda one: one[1], default=None)


@dataclass(frozen=True, slots=True)
class UnreadableCell:
    """A cell whose file, or that of its controller, cannot be used."""

    path: Path
    error: HexacellError


def cell_status(cell: Cell) -> CellStatus:
    """The status of a cell, from its run folders.

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
    """When the geometry that the controller has is no longer valid; None where that is not known."""
    valid_days = cell.settings.acceptance.valid_days
    ended = in_force and in_force.summary.ended
    return ended + timedelta(days=valid_days) if ended and valid_days is not None else None


class FleetCell(Frozen):
    """How a cell was when it was seen last. Errors in mm.

    Attributes:
        host, cell: the computer it is run from, and its cell file there.
        seen_at: when it put this into the archive, UTC.
        latest_run, latest_at, mode: of the run that ended last.
        verdict, position_mm, expanded_mm, judged_at: of the last one with a verdict.
        due_at: when the next calibration is due, where its cell file says how long one is valid.
        proposal: the newest run whose proposal waits for a person.
        changes: of the robot, that the watch over all runs found.
    """

    name: Name
    host: Text
    cell: Text
    seen_at: datetime
    latest_run: Text | None = None
    latest_at: datetime | None = None
    mode: Text = ""
    verdict: Verdict | None = None
    position_mm: float | None = None
    expanded_mm: float | None = None
    judged_at: datetime | None = None
    passed_at: datetime | None = None
    due_at: datetime | None = None
    proposal: Text | None = None
    changes: int = 0

    @property
    def is_overdue(self) -> bool:
        """Whether its calibration is overdue, by this computer's clock."""
        return self.due_at is not None and self.due_at <= datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class FleetRun:
    """One run of one of the cells; ``place`` is the computer and folder of its runs."""

    cell: str
    place: str
    name: str
    summary: RunSummary

    @property
    def host(self) -> str:
        """The computer it was run from."""
        return self.place.partition(":")[0]


def publish_status(status: CellStatus) -> None:
    """Put the status of a cell into the archive that it shares, if it shares one.

    Raises:
        ArchiveUnavailable: it cannot be written.
    """
    cell = status.cell
    if cell.settings.archive.url is None:
        return
    from hexacell.runs.archive import Archive  # noqa: PLC0415 - SQLAlchemy only where it is used

    content = fleet_cell(status).model_dump_json().encode()
    with closing(Archive(runs_folder(cell), cell.settings.name, cell.settings.archive.url)) as archive:
        archive.store(DocumentKind.CELL, {OF_THE_CELL: StampedDocument(OF_THE_CELL, content)})


def fleet_cell(status: CellStatus) -> FleetCell:
    """The status of a cell as an archive has it."""
    latest, judged = status.latest, status.judged
    accuracy = None if judged is None else judged.summary.accuracy
    return FleetCell(
        name=status.cell.settings.name,
        host=socket.gethostname(),
        cell=str(status.cell.path.absolute()),
        seen_at=datetime.now(UTC),
        latest_run=None if latest is None else latest.name,
        latest_at=None if latest is None else latest.summary.ended,
        mode="" if latest is None else latest.summary.mode,
        verdict=None if judged is None else judged.summary.verdict,
        position_mm=None if accuracy is None else accuracy.position.value,
        expanded_mm=None if accuracy is None else accuracy.position.expanded,
        judged_at=None if judged is None else judged.summary.ended,
        passed_at=status.passed_at,
        due_at=status.due_at,
        proposal=None if status.proposal is None else status.proposal.name,
        changes=len(status.drift.changes),
    )


def fleet_cells(url: str) -> tuple[FleetCell, ...]:
    """All cells of an archive, by name; without those that a newer program has put there.

    Raises:
        ArchiveUnavailable: it cannot be read.
    """
    documents = _shared_documents(url, DocumentKind.CELL)
    found = (_read(FleetCell, one) for one in documents)
    return tuple(one for one in found if one is not None)


def fleet_runs(url: str) -> tuple[FleetRun, ...]:
    """The runs of all cells of an archive, the newest first.

    Raises:
        ArchiveUnavailable: it cannot be read.
    """
    documents = _shared_documents(url, DocumentKind.SUMMARY)
    found = [
        FleetRun(one.cell, one.place, one.run, summary)
        for one in documents
        if (summary := _read(RunSummary, one)) is not None
    ]
    return tuple(sorted(found, key=_recency, reverse=True))


def _recency(run: FleetRun) -> tuple[float, str, str]:
    ended = run.summary.ended
    return 0.0 if ended is None else ended.timestamp(), run.cell, run.name


def _shared_documents(url: str, kind: DocumentKind) -> tuple[SharedDocument, ...]:
    from hexacell.runs.archive import shared_documents  # noqa: PLC0415 - SQLAlchemy only where used

    return shared_documents(url, kind)


def _read(model: type[Model], document: SharedDocument) -> Model | None:
    """What a document holds; None where a newer program has written it."""
    try:
        return model.model_validate_json(document.content)
    except ValidationError:
        return None
