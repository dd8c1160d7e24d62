"""A journal that is no longer what its run wrote: the run stops in place, writes nothing, and says so."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from hexacell.errors import ExitCode, HexacellError, Interruption, WriteBackUndone
from procedures.journal.journal import EvidenceLost, Journal, is_evidence_lost
from procedures.steps import events
from tests.procedures.runs.listening import at_step, on

COMMITTED = events.Committed(approved_by="a tester")


def append_last_line(path: Path) -> None:
    with path.open("ab") as file:
        file.write(path.read_bytes().splitlines(keepends=True)[-1])


def change_a_byte(path: Path) -> None:
    with path.open("r+b") as file:
        file.seek(20)
        file.write(b"#")


SPOILT: dict[str, tuple[Callable[[Path], object], str]] = {
    "deleted": (Path.unlink, "is gone"),
    "folder moved": (lambda path: path.parent.rename(path.parent.with_name("moved")), "is gone"),
    "replaced": (
        lambda path: Path(shutil.copy2(path, f"{path}-2")).replace(path),
        "was replaced by another file",
    ),
    "cut short": (lambda path: os.truncate(path, path.stat().st_size - 9), "was cut short"),
    "emptied": (lambda path: path.write_bytes(b""), "was cut short"),
    "continued": (append_last_line, "was written by somebody else"),
    "changed": (change_a_byte, "was changed"),
}


@pytest.fixture(params=SPOILT)
def spoilt(request) -> tuple[Callable[[Path], object], str]:
    return SPOILT[request.param]


def test_nothing_is_added_to_a_journal_that_is_not_the_own(tmp_path: Path, spoilt) -> None:
    spoil, why = spoilt
    path = tmp_path / "run" / "journal.jsonl"
    path.parent.mkdir()
    with Journal(path) as journal:
        for _ in range(3):
            journal.append(COMMITTED)
        spoil(path)
        left = path.read_bytes() if path.exists() else None
        with pytest.raises(EvidenceLost, match=why):
            journal.require_read_back()
        if why != "was changed":  # within one step of the file's times that is seen by reading alone
            with pytest.raises(EvidenceLost, match=why):
                journal.append(COMMITTED)
        assert (path.read_bytes() if path.exists() else None) == left


def test_a_journal_that_was_only_touched_goes_on(tmp_path: Path) -> None:
    with Journal(path := tmp_path / "journal.jsonl") as journal:
        journal.append(COMMITTED)
        path.touch()
        (tmp_path / "link").hardlink_to(path)
        journal.append(COMMITTED)
        journal.require_read_back()


async def test_a_run_without_its_journal_writes_no_config(recording, replayed, spoilt) -> None:
    """It is lost while a person thinks about the approval."""
    spoil, why = spoilt
    rig = replayed(recording.until(events.Proposed))
    with pytest.raises(HexacellError, match=why) as lost:
        await rig.run(at_step("commit", lambda: spoil(rig.folder.journal)))
    assert is_evidence_lost(lost.value)
    assert rig.config == recording.config_before
    assert rig.controller.log[-1] == "stop"
    assert "reload" not in rig.controller.log


@pytest.mark.parametrize("stopped", [False, True])
async def test_no_step_is_begun_without_the_journal_and_who_stops_learns_of_it(
    recording, replayed, stopped: bool
) -> None:
    rig = replayed(recording.until(events.RecordTaken, count=2))

    def lose() -> None:
        rig.folder.journal.unlink()
        if stopped:
            raise Interruption("enough")

    with pytest.raises(HexacellError, match="enough" if stopped else "is gone") as lost:
        await rig.run(on(events.Arrived, lose))
    assert is_evidence_lost(lost.value)
    assert [entry.split()[0] for entry in rig.controller.log].count("move") == 1
    assert rig.controller.log[-1] == "stop"


async def test_a_written_geometry_is_taken_back_where_its_journal_is_lost(recording, replayed) -> None:
    rig = replayed(recording.until(events.Committed))
    with pytest.raises(
        WriteBackUndone, match=r"the old config is back\. .*is gone.*Begin a new run"
    ) as undone:
        await rig.run(on(events.Arrived, rig.folder.journal.unlink))
    assert is_evidence_lost(undone.value)
    assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
    assert rig.config == recording.config_before
