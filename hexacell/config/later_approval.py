"""Who had the proposal of a run written after the run."""

from datetime import datetime
from pathlib import Path
from typing import ClassVar

from hexacell.config.change import JsonRecord
from hexacell.runs.run_folder import RunFolder


class LaterApproval(JsonRecord):
    """Who had a proposal written after its run, and when: ``applied.json`` in the run folder."""

    noun: ClassVar[str] = "approval of a proposal"

    by: str
    at: datetime
    sha256_after: str


def later_approval(folder: RunFolder) -> LaterApproval | None:
    """Who had the proposal of a run written after it; None if nobody did. Raises ``FileError``."""
    path = approval_path(folder)
    return LaterApproval.load(path) if path.exists() else None


def approval_path(folder: RunFolder) -> Path:
    """Where that is noted."""
    return folder.path / "applied.json"
