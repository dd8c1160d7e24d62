"""The controller's config brought back to an earlier one that the cell's runs have kept, bit for bit."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.controller_config.change import diff
from hexacell.controller_config.three_way import ConfigEditedSince, compare_versions
from hexacell.controller_config.write_back import AFTER, BEFORE, Receipt, restore
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.robot_model import config_format
from hexacell.runs.run_folder import RunFolder, find_run, runs_folder
from hexacell.storage import atomic_files
from hexacell.storage.cell_lock import cell_lock
from procedures.engine.config_transactions import holds_provisional
from procedures.journal.line_format import RESTORE


@dataclass(frozen=True, slots=True)
class ConfigRollback:
    """What a rollback did.

    Attributes:
        undone: the run whose geometry the config had; none where it had that of before all runs.
        restored: the file in a run folder that the config is a copy of now.
        change: the change of the text, as a unified diff; empty where nothing had to be written.
    """

    path: Path
    undone: Path | None
    restored: Path
    change: str


def roll_back_config(cell: Cell, to: str | None = None) -> ConfigRollback:
    """Undo the latest write into the config, or restore what the run ``to`` wrote.

    Raises:
        UsageError: nothing is to be undone, there is no such run, or it wrote nothing.
        ConfigEditedSince: the config was edited since it was written.
        CellBusy: the cell is in use.
        FileError: a file cannot be read or written, or the kept one is damaged.
    """
    path = cell.config_path
    with cell_lock(path):
        receipts = list(_receipts(cell))
        found = atomic_files.read_bytes(path)
        undone = _written_by(receipts, found)
        restored = _written_file(cell, to) if to is not None else _file_before(cell, undone, receipts)
        data = atomic_files.read_bytes(restored)
        _require_known(cell, receipts, found)
        if data != found:
            restore(path, data, expected=found)
    change = diff(found.decode(errors="replace"), data.decode(errors="replace"))
    return ConfigRollback(path, None if undone is None else undone.backup_folder, restored, change)


def _receipts(cell: Cell) -> Iterator[Receipt]:
    """Those of the cell's config, the oldest first; folders that cannot be read are left out."""
    folder = runs_folder(cell)
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        try:
            receipt = Receipt.of(path)
        except HexacellError:
            continue
        if os.path.realpath(receipt.path) == os.path.realpath(cell.config_path):
            yield receipt


def _written_by(receipts: list[Receipt], found: bytes) -> Receipt | None:
    """The newest run that wrote this config."""
    sha256 = atomic_files.sha256(found)
    return next((one for one in reversed(receipts) if one.sha256_after == sha256), None)


def _file_before(cell: Cell, undone: Receipt | None, receipts: list[Receipt]) -> Path:
    if undone is not None:
        undone.backup()
        return undone.backup_folder / BEFORE
    if receipts:
        _require_known(cell, receipts, atomic_files.read_bytes(cell.config_path))
    raise UsageError(
        "no run of this cell wrote the config that is there now: nothing is to be undone",
        subject=cell.config_path,
        action=f"Name a run with --to; the cell's runs are in {runs_folder(cell)}",
    )


def _written_file(cell: Cell, named: str) -> Path:
    """The config as a run wrote it."""
    folder = find_run(cell, named)
    try:
        receipt = Receipt.of(folder.path)
    except HexacellError as error:
        raise UsageError(
            f"the run {folder.path} wrote no config", action="Name a run that wrote one"
        ) from error
    if os.path.realpath(receipt.path) != os.path.realpath(cell.config_path):
        raise UsageError(
            f"the run {folder.path} is of another config, {receipt.path}", action="Name a run of this cell"
        )
    written = folder.path / AFTER
    data = atomic_files.read_bytes(written)
    if written.is_symlink() or atomic_files.sha256(data) != receipt.sha256_after:
        raise FileError("this copy of the config is damaged", subject=written, action=RESTORE)
    return written


def _require_known(cell: Cell, receipts: list[Receipt], found: bytes) -> None:
    """What a rollback replaces must be kept in a run folder; else an edit would be lost."""
    path, sha256 = cell.config_path, atomic_files.sha256(found)
    if any(sha256 in {one.sha256_before, one.sha256_after} for one in receipts):
        return
    folder = runs_folder(cell)
    for run in sorted(folder.iterdir()) if folder.is_dir() else ():
        if holds_provisional(RunFolder(run), path):
            raise UsageError(
                f"the run {run} left its provisional geometry here",
                subject=path,
                action="Resume that run, which takes it back",
            )
    if not receipts:
        raise UsageError(
            "no run of this cell wrote it: it would be lost", subject=path, action="Keep a copy elsewhere"
        )
    raise _edited_since(cell, receipts[-1])


def _edited_since(cell: Cell, latest: Receipt) -> ConfigEditedSince:
    form, folder = config_format(cell.settings), latest.backup_folder
    before, written = (
        (form.read(kept).geometry, atomic_files.read_text(kept))
        for kept in (folder / BEFORE, folder / AFTER)
    )
    return ConfigEditedSince(
        f"the config was edited since {folder.name} wrote it; rolling back would lose that",
        compare_versions(cell.config_path, form, before, written),
        path=cell.config_path,
        action="Nothing was written: undo the edit, or keep a copy and calibrate again",
    )
