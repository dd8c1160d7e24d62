"""A run folder that says more than its records give, or is of another cell, writes nothing by ``apply``."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from hexacell.cell.loader import Cell, load_cell
from hexacell.config.change import AFTER, ConfigChange
from hexacell.config.layout import fingerprint_of
from hexacell.errors import FileError, HexacellError, UsageError
from hexacell.runs.run_folder import RunFolder
from hexacell.services.write_back.config_history import config_history
from hexacell.services.write_back.config_rollback import roll_back_config
from hexacell.services.write_back.proposals import apply_proposal, read_proposal
from procedures.journal.journal import Entry, encode, read_entries
from procedures.steps import events


@dataclass(frozen=True)
class Copied:
    """A machine's folder, copied elsewhere after its calibration."""

    cell: Cell
    folder: RunFolder

    @property
    def config(self) -> bytes:
        return self.cell.config_path.read_bytes()

    def change(self, kind: type[Any], alter: Callable[[Any], Any]) -> None:
        """Alter the last event of a kind in the journal, whose checksums are right again."""
        entries: list[Entry] = list(read_entries(self.folder.journal))
        place = max(n for n, entry in enumerate(entries) if isinstance(entry.event, kind))
        entries[place] = replace(entries[place], event=alter(entries[place].event))
        self.folder.journal.write_bytes(b"".join(map(encode, entries)))

    def propose(self, **changes: Any) -> None:
        """Another proposal, whose checksum is right."""
        change = ConfigChange.load(self.folder.proposal).model_copy(update=changes)
        sums = {"sha256_after": fingerprint_of(change.after_contents)}
        change.model_copy(update=sums).save(self.folder.proposal)


@pytest.fixture
def calibrated(finished, tmp_path: Path) -> Copied:
    """With the config that the run wrote."""
    machine, copy = finished.cell.path.parent, tmp_path / "copy"
    shutil.copytree(machine, copy)
    cell = load_cell(copy / finished.cell.path.name)
    return Copied(cell, RunFolder(copy / finished.folder.path.relative_to(machine)))


@pytest.fixture
def proposed(calibrated: Copied, finished) -> Copied:
    """With the config as it was before the run."""
    calibrated.cell.config_path.write_bytes(finished.config_before)
    return calibrated


async def applied(copied: Copied) -> str:
    return (await apply_proposal(read_proposal(copied.folder), None)).by


async def test_what_the_records_give_is_written_into_the_config_of_the_copy(proposed, finished) -> None:
    original, after = finished.cell.config_path.read_bytes(), (finished.folder.path / AFTER).read_bytes()
    assert await applied(proposed)
    assert proposed.config == after
    assert finished.cell.config_path.read_bytes() == original


def other(event: Any, **changes: Any) -> Any:
    return event.model_copy(update=changes)


def moved(document: dict[str, Any]) -> dict[str, Any]:
    return {**document, "l": tuple(one + 0.5 for one in document["l"])}


def text(copied: Copied) -> None:
    copied.propose(text_after=ConfigChange.load(copied.folder.proposal).text_after + "# and more\n")


def path(copied: Copied) -> None:
    copied.propose(path=copied.cell.path.parent / "victim")


def gates(copied: Copied) -> None:
    copied.change(events.Proposed, lambda event: other(event, gates=event.gates[:1]))


def geometry(copied: Copied) -> None:
    copied.change(events.Proposed, lambda event: other(event, written=moved(event.written)))
    copied.propose(after=moved(ConfigChange.load(copied.folder.proposal).after))


def identified(copied: Copied) -> None:
    def changed(event: events.Identified) -> Any:
        return other(event, result=other(event.result, geometry=moved(event.result.geometry)))

    copied.change(events.Identified, changed)


def records(copied: Copied) -> None:
    def changed(event: events.RecordTaken) -> Any:
        mm = tuple(one + 0.2 for one in event.reading.gauges_mm)
        return other(event, reading=other(event.reading, gauges_mm=mm))

    copied.change(events.RecordTaken, changed)


def verdict(copied: Copied) -> None:
    def changed(event: events.ResultValidated) -> Any:
        return other(event, verification=other(event.verification, after_mm=0.0))

    copied.change(events.ResultValidated, changed)


def steps(copied: Copied) -> None:
    """What nobody began is computed by nobody."""
    entries = read_entries(copied.folder.journal)
    left = [one for one in entries if not isinstance(one.event, events.StepBegun)]
    numbered = [replace(one, number=number) for number, one in enumerate(left, start=1)]
    copied.folder.journal.write_bytes(b"".join(map(encode, numbered)))


@pytest.mark.parametrize("forge", [text, path, gates, geometry, identified, records, verdict, steps])
async def test_a_forged_folder_is_refused(proposed, forge: Callable[[Copied], None]) -> None:
    (proposed.cell.path.parent / "victim").write_bytes(proposed.config)
    before = proposed.config
    forge(proposed)
    with pytest.raises(FileError, match=r"give another proposal|not the one of its journal"):
        await applied(proposed)
    assert proposed.config == (proposed.cell.path.parent / "victim").read_bytes() == before


async def test_a_folder_that_is_not_of_the_cell_beside_it_is_refused(proposed, tmp_path) -> None:
    before = proposed.config
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(proposed.folder.path, elsewhere)
    with pytest.raises(UsageError, match="is not beside it"):
        read_proposal(RunFolder(elsewhere))
    (proposed.folder.path / "write-back.json").unlink()
    (proposed.folder.path / "write-back.json").symlink_to(elsewhere / "write-back.json")
    with pytest.raises(HexacellError, match="is a link"):
        await applied(proposed)
    (proposed.folder.path / "write-back.json").unlink()
    proposed.cell.path.write_text(proposed.cell.text.replace("position_mm = ", "position_mm = 1", 1))
    with pytest.raises(UsageError, match="is not beside it"):
        read_proposal(proposed.folder)
    assert proposed.config == before


def test_a_machine_that_was_copied_is_rolled_back_in_its_copy_alone(calibrated, finished) -> None:
    original, written = finished.cell.config_path.read_bytes(), calibrated.config
    assert [one.record.run for one in config_history(calibrated.cell).writes]
    done = roll_back_config(calibrated.cell)
    assert (calibrated.config, done.undone) == (finished.config_before, calibrated.folder.path)
    roll_back_config(calibrated.cell, calibrated.folder.name)
    assert calibrated.config == written
    assert finished.cell.config_path.read_bytes() == original


def test_where_the_program_may_not_restore_a_version_it_says_how_a_person_does(calibrated) -> None:
    config = calibrated.cell.config_path.rename(calibrated.cell.config_path.with_name("old.toml"))
    note = calibrated.folder.path / "write-back.json"
    note.write_text(note.read_text().replace(calibrated.cell.config_path.name, config.name))
    shutil.copy(config, calibrated.cell.config_path)
    with pytest.raises(UsageError, match="is of another config") as refused:
        roll_back_config(calibrated.cell, calibrated.folder.name)
    assert refused.value.action is not None
    assert f"copy {calibrated.folder.path / AFTER} over the config by hand" in refused.value.action
