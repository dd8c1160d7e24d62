"""The config of a cell, held by this process and whole: no write of several files is half done."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hexacell.config.pending_write import (
    InterruptedWrite,
    is_interrupted,
    settle_interrupted_write,
)
from hexacell.errors import CellBusy, FileError
from hexacell.runs.cell_lock import cell_lock


@contextmanager
def held_config(*paths: Path) -> Iterator[None]:
    """Hold the cell whose config these files are until the context ends; never waits.

    Raises:
        CellBusy: another process holds it.
        FileError: a write of its config was interrupted since the command began. It is settled now.
    """
    with cell_lock(*paths):
        if (settled := settle_interrupted_write(paths)) is not None:
            raise FileError(interrupted_sentence(settled), subject=paths[0], action="Try again")
        yield


def settle_config(*paths: Path) -> str | None:
    """Settle what a process that was killed left of a write; what became of it, none if there is nothing.

    Where another process holds the cell, it is left to that one.

    Raises:
        FileError: a file was edited since, or cannot be written.
    """
    if not is_interrupted(paths):
        return None
    try:
        with cell_lock(*paths):
            settled = settle_interrupted_write(paths)
    except CellBusy:
        return None
    return None if settled is None else interrupted_sentence(settled)


def interrupted_sentence(settled: InterruptedWrite) -> str:
    """What is said of it."""
    files = " and ".join(settled.files)
    if settled.is_complete:
        return f"a write of {files} was interrupted when all of them were new: it is complete"
    if not settled.restored:
        return f"a write of {files} was interrupted before any of them was replaced: all are as before"
    restored = " and ".join(settled.restored)
    return f"a write of {files} was interrupted between them: {restored} got the old content back"
