"""What an archive keeps: documents derived from run folders, each with the stamp of its folder then."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from hexacell.errors import FileError


class DocumentKind(StrEnum):
    """What the archive keeps of a run; of a cell, under no run's name, what others are told of it."""

    SUMMARY = "summary"
    RESULT = "result"
    EVIDENCE = "evidence"
    CELL = "cell"


@dataclass(frozen=True, slots=True)
class StampedDocument:
    """A document that was derived from a run folder when that had the ``stamp``."""

    stamp: str
    content: bytes


class ArchiveUnavailable(FileError):
    """The archive cannot be used; what is asked of it must be read from the folders."""
