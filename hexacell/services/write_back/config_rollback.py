"""The controller's config brought back to an earlier one that the cell's runs have kept, bit for bit."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hexacell.cell.loader import Cell
from hexacell.config.change import AFTER, BEFORE, Receipt, diff_of_files
from hexacell.config.layout import ConfigLayout, Contents, are_same_files, fingerprint_of, read_contents
from hexacell.config.pending_write import held_config
from hexacell.config.versions import ConfigEditedSince, compare_versions
from hexacell.config.write_back import restore
from hexacell.config.write_record import Recording, WriteCause, WriteKind, recorded_write, stated_reason
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.runs.run_folder import find_run, run_folders, runs_folder
from hexacell.services.write_back.proposals import COMMAND
from procedures.journal.journal import RESTORE
from procedures.resources.controller_config import require_no_provisional


@dataclass(frozen=True, slots=True)
class ConfigRollback:
    """What a rollback did.

    Attributes:
        undone: the run whose geometry the config had; None where it had that from before all runs.
        restored: the files in a run folder that the config is now a copy of.
        change: the change of the text, as a unified diff; empty where nothing had to be written.
        unrecorded: why the history has no record of it, in a sentence; empty if it has.
    """

    paths: tuple[Path, ...]
    undone: Path | None
    restored: tuple[Path, ...]
    change: str
    unrecorded: str = ""


def roll_back_config(
    cell: Cell, to: str | None = None, *, by: str = COMMAND, reason: str = ""
) -> ConfigRollback:
    """Undo the latest write into the config, or restore what the run ``to`` wrote.

    ``by`` is who decided on it, ``reason`` why, as the history of the config is to have both.

    Raises:
        UsageError: nothing is to be undone, there is no such run, or it wrote nothing; or ``reason`` is no
            line of text.
        ConfigEditedSince: the config was edited since it was written.
        CellBusy: the cell is in use.
        FileError: a file cannot be read or written, or the kept one is damaged.
    """
    paths, reason, recording = cell.config_paths, stated_reason(reason), Recording()
    with held_config(*cell.config_paths):
        receipts = list(receipts_of(cell))
        found = read_contents(paths)
        sha256 = fingerprint_of(found)
        undone = next((one for one in reversed(receipts) if one.sha256_after == sha256), None)
        if to is not None:
            restored, contents = _written_files(cell, to)
        else:
            restored, contents = _files_before(cell, undone, receipts)
        _require_known(cell, receipts, found, restored)
        if contents != found:
            run = restored[0].parent.name
            why = f"by hand, as it was before {run}" if to is None else f"by hand, as {run} wrote it"
            if to is not None and undone is not None:
                why += f", in place of {undone.backup_folder.name}"
            cause = WriteCause(WriteKind.ROLLED_BACK, by, run, why, reason)
            with recorded_write(
                runs_folder(cell), paths, ConfigLayout.of(cell.settings), cause
            ) as recording:
                restore(paths, contents, expected=found)
    change = diff_of_files(paths, found, contents)
    folder = None if undone is None else undone.backup_folder
    return ConfigRollback(paths, folder, restored, change, recording.problem)


def receipts_of(cell: Cell) -> Iterator[Receipt]:
    """Receipts of the cell's config, the oldest first; folders that cannot be read are left out."""
    for folder in run_folders(cell):
        try:
            receipt = Receipt.of(folder.path)
        except HexacellError:
            continue
        if are_same_files(receipt.paths, cell.config_paths):
            yield receipt


def _files_before(
    cell: Cell, undone: Receipt | None, receipts: list[Receipt]
) -> tuple[tuple[Path, ...], Contents]:
    if undone is not None:
        return undone.kept(BEFORE), undone.backup()
    if receipts:
        _require_known(cell, receipts, read_contents(cell.config_paths), receipts[-1].kept(AFTER))
    raise UsageError(
        "no run of this cell wrote the config that is there now: nothing is to be undone",
        subject=cell.config_path,
        action=f"Name a run with --to; the cell's runs are in {runs_folder(cell)}",
    )


def _written_files(cell: Cell, named: str) -> tuple[tuple[Path, ...], Contents]:
    folder = find_run(cell, named)
    try:
        receipt = Receipt.of(folder.path)
    except HexacellError as error:
        raise UsageError(
            f"the run {folder.path} wrote no config", action="Name a run that wrote one"
        ) from error
    if not are_same_files(receipt.paths, cell.config_paths):
        raise UsageError(
            f"the run {folder.path} is of another config, {' and '.join(map(str, receipt.paths))}",
            action=f"If it is of this machine, copy {receipt.kept(AFTER)[0]} over the config by hand",
        )
    written = receipt.kept(AFTER)
    if link := next((path for path in written if path.is_symlink()), None):
        raise FileError("this copy of the config is damaged", subject=link, action=RESTORE)
    return written, receipt.written()


def _require_known(
    cell: Cell, receipts: list[Receipt], found: Contents, restored: tuple[Path, ...]
) -> None:
    """What a rollback replaces must be kept in a run folder; else an edit would be lost."""
    path, sha256 = cell.config_path, fingerprint_of(found)
    if any(sha256 in {one.sha256_before, one.sha256_after} for one in receipts):
        return
    require_no_provisional(cell)
    if not receipts:
        raise UsageError(
            "no run of this cell wrote it: it would be lost",
            subject=path,
            action=f"Keep a copy elsewhere, then copy {restored[0]} over it by hand",
        )
    raise _edited_since(cell, receipts[-1])


def _edited_since(cell: Cell, latest: Receipt) -> ConfigEditedSince:
    layout = ConfigLayout.of(cell.settings)
    before, written = (
        (layout.read(*latest.kept(name)), read_contents(latest.kept(name))) for name in (BEFORE, AFTER)
    )
    return ConfigEditedSince(
        f"the config was edited since {latest.backup_folder.name} wrote it; rolling back would lose that",
        compare_versions(cell.config_paths, layout, before, written),
        path=cell.config_path,
        action="Nothing was written: undo the edit, or keep a copy and calibrate again",
    )
