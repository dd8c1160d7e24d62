"""What is known of all runs of a cell, from the archive where it is as new as the run folders.

What is missing there, or older than its folder, is read from the folder and kept. Where the archive cannot
be used at all, everything is read from the folders.
"""

import base64
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from hexacell.cell.fields import Frozen
from hexacell.cell.loader import Cell
from hexacell.drift.run_evidence import RunEvidence
from hexacell.kinematics.rotations import Array
from hexacell.runs.run_folder import (
    ArchiveUnavailable,
    DocumentKind,
    RunFolder,
    StampedDocument,
    folder_stamps,
    runs_folder,
)
from hexacell.verdict.decision import JudgedError, Verdict, VerifiedAccuracy

BATCH = 100
"""Number of runs stored at once, so that an interrupted reading of thousands of folders is not lost."""

NOTHING = b""
"""What is kept of a run that has no such document."""

Document = TypeVar("Document", bound=BaseModel)


class RunSummary(Frozen):
    """What a run was, by its folder alone: what the archive keeps of it.

    Attributes:
        began, ended: when its first and its last event were written, UTC.
        mode: check, quick, optimise or length; empty where its journal cannot be read.
        verdict: None without one.
        accuracy: the errors at the task poses that the verdict is on; None without such a verdict.
        line: how it ended, in words; why its journal cannot be read, if it cannot.
        has_result: whether it identified a geometry of its own, with which no other result took part.
        is_over: whether it has ended; one that has not can be resumed.
        written_sha256: fingerprint of the controller's config as it wrote it; None if it did not.
        has_written: whether it wrote the config at all, whatever was undone.
        has_proposal: whether it has a proposal that is not in the config, and can be applied.
        has_begun: whether it began at all; one that was refused each time did not.
    """

    began: datetime | None = None
    ended: datetime | None = None
    mode: str = ""
    records: int = 0
    verdict: Verdict | None = None
    accuracy: VerifiedAccuracy | None = None
    line: str = ""
    has_result: bool = False
    is_over: bool = False
    written_sha256: str | None = None
    has_written: bool = False
    has_proposal: bool = False
    has_begun: bool = True

    @property
    def position(self) -> JudgedError | None:
        """The largest position error at the task poses, mm; None without one."""
        return None if self.accuracy is None else self.accuracy.position

    @property
    def document(self) -> dict[str, Any]:
        """What it was and found, as ``history --json`` prints it."""
        position = self.position
        return self.model_dump(include={"began", "ended", "records", "verdict", "line"}) | {
            "mode": self.mode or None,
            "position_mm": position and position.value,
            "expanded_mm": position and position.expanded,
            "limit_mm": position and position.limit,
            "begun": self.has_begun,
            "over": self.is_over,
            "written": self.has_written,
            "proposal": self.has_proposal,
        }


@dataclass(frozen=True, slots=True)
class PastRun:
    """One run of a cell; ``is_in_controller``: whether the controller's config is the one that it wrote."""

    folder: RunFolder
    summary: RunSummary
    is_in_controller: bool = False

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.folder.path.name


class EvidenceDocument(Frozen):
    """The evidence of one run, which ended ``at``; arrays as base64 of IEEE 754 doubles, little endian.

    ``information`` has the upper triangle, row by row. The first ``free`` numbers of the state are the free
    parameters, the others shared causes. ``celsius`` is the mean of all thermometers.
    """

    at: datetime
    celsius: float | None
    free: int
    information: str
    weighted: str

    @classmethod
    def of(cls, at: datetime, celsius: float | None, free: int, evidence: RunEvidence) -> Self:
        """The document of an evidence."""
        upper = evidence.information[np.triu_indices(len(evidence.weighted))]
        information, weighted = _base64(upper), _base64(evidence.weighted)
        return cls(at=at, celsius=celsius, free=free, information=information, weighted=weighted)

    @property
    def evidence(self) -> RunEvidence:
        """The evidence that the document holds."""
        weighted = _doubles(self.weighted)
        upper = np.zeros((len(weighted), len(weighted)))
        upper[np.triu_indices(len(weighted))] = _doubles(self.information)
        return RunEvidence(upper + np.triu(upper, 1).T, weighted)


class RunIndex:
    """The runs of a cell; ``warn`` is called with the reason if the archive cannot be used.

    ``url`` is that of a shared archive, if it is another than the cell file's.
    """

    def __init__(
        self, cell: Cell, url: str | None = None, warn: Callable[[str], None] = lambda _: None
    ) -> None:
        self._cell = cell
        self._folder = runs_folder(cell)
        self._url = cell.settings.archive.url if url is None else url
        self._warn = warn
        self._has_warned = False

    def documents(
        self,
        kind: DocumentKind,
        model: type[Document],
        read: Callable[[RunFolder], Document | None],
        runs: Iterable[str] | None = None,
        context: str = "",
    ) -> dict[str, Document]:
        """The documents of all runs, or of some, by name, of those that have one; raises ``FileError``.

        ``read`` derives a document from its folder, or None. ``context`` is a word for
        what it depends on beside the folder: documents of another one are derived again.
        """
        stamps = {name: f"{stamp} {context}" for name, stamp in folder_stamps(self._folder).items()}
        wanted = {name: stamps[name] for name in (stamps if runs is None else runs) if name in stamps}
        if not wanted:
            return {}
        from hexacell.runs.archive import Archive  # noqa: PLC0415 - SQLAlchemy only where it is read

        with closing(Archive(self._folder, self._cell.settings.name, self._url)) as archive:
            known: Mapping[str, StampedDocument] = {}
            with self._warned():
                known = archive.documents(kind)
                archive.forget([name for name in known if name not in stamps])
            found = {name: _decoded(model, known.get(name), stamp) for name, stamp in wanted.items()}
            unknown = [name for name, one in found.items() if one is _UNKNOWN]
            for start in range(0, len(unknown), BATCH):
                batch = unknown[start : start + BATCH]
                fresh = {name: read(RunFolder(self._folder / name)) for name in batch}
                if not self._has_warned:
                    with self._warned():
                        archive.store(kind, {name: _kept(fresh[name], stamps[name]) for name in batch})
                found |= fresh
        return {name: one for name, one in found.items() if isinstance(one, model)}

    @contextmanager
    def _warned(self) -> Iterator[None]:
        """Within this context an archive that cannot be used is a warning, and nothing is kept any more."""
        try:
            yield
        except ArchiveUnavailable as error:
            self._has_warned = True
            self._warn(str(error))


_UNKNOWN = object()


def _decoded(model: type[Document], kept: StampedDocument | None, stamp: str) -> Document | object | None:
    """What is kept of a run, if its folder has not changed since and the content is whole."""
    if kept is None or kept.stamp != stamp:
        return _UNKNOWN
    try:
        return None if kept.content == NOTHING else model.model_validate_json(kept.content)
    except ValidationError:
        return _UNKNOWN


def _kept(document: BaseModel | None, stamp: str) -> StampedDocument:
    content = NOTHING if document is None else document.model_dump_json().encode()
    return StampedDocument(stamp, content)


def _base64(values: Array) -> str:
    return base64.b64encode(values.astype("<f8").tobytes()).decode()


def _doubles(text: str) -> Array:
    return np.frombuffer(base64.b64decode(text), dtype="<f8").astype(np.float64)
