"""Notices that somebody edited the controller's config during a run, before the robot moves again.

The records of a run are commanded with the geometry of its config. The file must therefore be the one that
the run began with, or the one that the run itself wrote and has not reverted.
"""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

from hexacell.config.change import ConfigChange
from hexacell.config.layout import Contents, fingerprint_of, read_contents
from hexacell.config.receipt import RECEIPT, Receipt
from hexacell.errors import FileError
from hexacell.runs.run_folder import RunFolder
from procedures.run.state import RunState

PROVISIONAL_FOLDER = "lent"
UNDO = "Undo the edit and retry; if the run has ended, resume it then"


class ConfigEdits:
    """Compares the config of one run with what it should be."""

    def __init__(self, paths: tuple[Path, ...], folder: RunFolder) -> None:
        self._paths = paths
        self._folder = folder
        self._unedited: Contents | None = None

    def require_none(self, state: RunState) -> None:
        """Make sure that the config is as the run has it; while it is being changed, it may be either.

        Raises:
            FileError: it was edited; with the first line that differs, if this process has seen it before.
        """
        expected = expected_fingerprints(self._folder, state)
        if not expected:
            return
        found = read_contents(self._paths)
        if fingerprint_of(found) in expected:
            self._unedited = found
            return
        raise edited(*self._first_difference(found))

    def _first_difference(self, found: Contents) -> tuple[Path, int | None]:
        """The first file that differs, and its first line that does; no line if that is not known."""
        for path, old, new in zip(self._paths, self._unedited or (), found, strict=False):
            if old != new:
                return path, _first_line(old, new)
        return self._paths[0], None


def expected_fingerprints(folder: RunFolder, state: RunState) -> set[str]:
    """The fingerprints that the config may have by now; none where that is not known."""
    if state.started is None or state.config_write_pending or state.rolling_back:
        return set()
    if state.committed is not None and not state.rolled_back:
        return {Receipt.of(folder.path).sha256_after}
    if state.provisional_active:
        return {Receipt.of(folder.path / PROVISIONAL_FOLDER).sha256_after}
    expected = {state.started.config_sha256}
    if state.proposed is not None and (folder.path / RECEIPT).is_file():  # killed while it was written
        expected.add(ConfigChange.load(folder.proposal).sha256_after)
    return expected


def edited(path: Path, line: int | None = None) -> FileError:
    """The error for a config that is not as the run has it."""
    return FileError(
        "the config changed since the run began, whose records were commanded with the geometry before",
        subject=path,
        line=line,
        action=UNDO,
    )


def _first_line(before: bytes, now: bytes) -> int | None:
    """The first line, from 1, that differs."""
    lines = zip_longest(before.split(b"\n"), now.split(b"\n"))
    return next((number for number, (old, new) in enumerate(lines, start=1) if old != new), None)
