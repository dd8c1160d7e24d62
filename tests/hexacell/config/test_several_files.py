"""A write of several files leaves all of them new or all of them old, whatever fails, and when."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from hexacell.config.change import AFTER, BEFORE, ConfigChange, Receipt
from hexacell.config.layout import read_contents
from hexacell.config.pending_write import is_interrupted, note_path, note_write, settle_interrupted_write
from hexacell.config.write_back import commit, restore, rollback
from hexacell.errors import FileError, HexacellError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from tests.hexacell.config.conftest import Bench
from tests.several_config_files import LAYOUT, drawn_geometry


def test_both_are_written_and_undone_bit_for_bit(bench: Bench, tmp_path: Path) -> None:
    receipt = bench.commit(tmp_path / "run")
    assert bench.found == bench.after
    assert all(old != new for old, new in zip(bench.before, bench.after, strict=True))
    geometry = LAYOUT.read(*bench.files).geometry
    assert geometry.vector == pytest.approx(drawn_geometry().vector + 1.25, abs=1e-6)
    assert receipt.backup() == bench.before
    assert [path.name for path in receipt.kept(BEFORE)] == ["config-before", "config-before-2"]
    assert read_contents(receipt.kept(AFTER)) == bench.after
    assert sorted(path.name for path in bench.files[0].parent.iterdir()) == ["hexapod.hal", "hexapod.ini"]
    rollback(Receipt.of(tmp_path / "run"))
    assert bench.found == bench.before
    rollback(receipt)
    assert bench.found == bench.before


def test_the_change_shows_each_file_by_its_name_and_survives_its_own(bench: Bench, tmp_path: Path) -> None:
    bench.change.save(tmp_path / "proposal.json")
    assert ConfigChange.load(tmp_path / "proposal.json") == bench.change
    hal, ini = bench.change.diff.split("--- hexapod.ini\n")
    assert hal.startswith("--- hexapod.hal\n+++ hexapod.hal\n")
    assert "+setp genhexkins.base.0.x -474.25  # leg 1" in hal
    assert ini.startswith("+++ hexapod.ini\n")
    assert "+HOME_OFFSET = 601.25" in ini


@pytest.mark.parametrize("key", ["text_before", "text_after"])
def test_an_edited_change_of_the_second_file_is_refused(bench: Bench, tmp_path: Path, key: str) -> None:
    path = tmp_path / "proposal.json"
    text = getattr(bench.change.further[0], key)
    further = (bench.change.further[0].model_copy(update={key: f"{text} "}),)
    bench.change.model_copy(update={"further": further}).save(path)
    with pytest.raises(FileError, match="does not have the checksum stated"):
        ConfigChange.load(path)


def test_the_same_geometry_writes_nothing(either: Bench, tmp_path: Path) -> None:
    inodes = [path.stat().st_ino for path in either.files]
    receipt = commit(either.changed_to(either.layout.read(*either.files).geometry), tmp_path / "run")
    assert [path.stat().st_ino for path in either.files] == inodes
    rollback(receipt)
    assert [path.stat().st_ino for path in either.files] == inodes


def test_a_change_of_one_file_leaves_the_other_alone(bench: Bench, tmp_path: Path) -> None:
    vector = drawn_geometry().vector.copy()
    vector[-6:] += 0.5
    geometry = Geometry(drawn_geometry().parameters, vector)
    change = bench.changed_to(geometry)
    inode = bench.files[0].stat().st_ino
    assert change.diff.count("--- ") == 1
    receipt = commit(change, tmp_path / "run")
    assert bench.files[0].stat().st_ino == inode
    assert bench.found == change.after_contents
    rollback(receipt)
    assert bench.found == bench.before


def test_a_write_that_was_complete_stays(bench: Bench, tmp_path: Path) -> None:
    receipt = bench.commit(tmp_path / "run")
    note_write(bench.files, bench.before, bench.after)
    settled = settle_interrupted_write(bench.files)
    assert settled is not None
    assert settled.endswith("it is complete")
    assert bench.found == bench.after
    assert not is_interrupted(bench.files)
    rollback(receipt)


def test_another_order_of_the_files_finds_the_note(bench: Bench) -> None:
    note_write(bench.files, bench.before, bench.after)
    bench.files[0].write_bytes(bench.after[0])
    settled = settle_interrupted_write(bench.files[::-1])
    assert settled is not None
    assert settled.endswith("hexapod.hal got the old content back")
    assert bench.found == bench.before


def test_an_edit_after_the_kill_is_not_lost(bench: Bench) -> None:
    note_write(bench.files, bench.before, bench.after)
    bench.files[0].write_bytes(bench.after[0])
    bench.files[1].write_bytes(b"[MINE]\n")
    with pytest.raises(FileError, match="was interrupted, and this file was edited since") as caught:
        settle_interrupted_write(bench.files)
    assert caught.value.subject == str(bench.files[1])
    assert str(note_path(bench.files)) in str(caught.value)
    assert bench.found == (bench.after[0], b"[MINE]\n")


def test_a_note_writes_no_file_that_is_not_the_cell_s(bench: Bench, tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_bytes(b"new")
    note_write((*bench.files, precious), (*bench.before, b"old"), (*bench.after, b"new"))
    note_path((*bench.files, precious)).rename(note_path(bench.files))
    with pytest.raises(FileError, match="which are not the files that this cell file names"):
        settle_interrupted_write(bench.files)
    assert precious.read_bytes() == b"new"


@pytest.mark.parametrize("text", [b"", b"{}", b"[]", b'{"version": 1, "files": 3}'])
def test_a_damaged_note_is_told(bench: Bench, text: bytes) -> None:
    note_path(bench.files).write_bytes(text)
    with pytest.raises(FileError, match="this is not a note of a write"):
        settle_interrupted_write(bench.files)


def test_the_note_is_no_link_and_no_more_readable_than_the_files(bench: Bench, tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_bytes(b"precious")
    note_path(bench.files).symlink_to(precious)
    with pytest.raises(FileError, match="is a link"):
        bench.commit(tmp_path / "run")
    assert (precious.read_bytes(), bench.found) == (b"precious", bench.before)
    bench.files[1].chmod(0o600)
    note_write(bench.files, bench.before, bench.after)
    assert note_path(bench.files).stat().st_mode & 0o077 == 0


def test_a_second_file_that_cannot_be_written_stops_it_before_the_first(bench, tmp_path, monkeypatch):
    real = os.access

    def access(path: Any, mode: int, **options: Any) -> bool:
        return real(path, mode, **options) and Path(path) != bench.files[1].resolve()

    monkeypatch.setattr(os, "access", access)
    monkeypatch.setattr(os, "supports_effective_ids", set())
    inode = bench.files[0].stat().st_ino
    with pytest.raises(FileError, match=r"hexapod\.ini: cannot be written and is unchanged: permission"):
        bench.commit(tmp_path / "run")
    assert bench.found == bench.before
    assert bench.files[0].stat().st_ino == inode
    assert not is_interrupted(bench.files)


def test_a_second_file_whose_disk_is_full_takes_the_first_one_back(bench, tmp_path, monkeypatch) -> None:
    real = os.replace

    def replace(source: Any, target: Any) -> None:
        if Path(target) == bench.files[1].resolve():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(source, target)

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(WriteBackUndone, match=r"was undone, the config is unchanged .*the disk is full"):
        bench.commit(tmp_path / "run")
    assert bench.found == bench.before
    assert not is_interrupted(bench.files)
    receipt = Receipt.of(tmp_path / "run")
    with pytest.raises(FileError, match="disk is full"):
        restore(bench.files, bench.after, expected=bench.before)
    assert bench.found == bench.before
    rollback(receipt)


@pytest.mark.parametrize("number", [0, -1])
def test_a_file_that_was_edited_since_is_named(either: Bench, tmp_path: Path, number: int) -> None:
    path = either.files[number]
    edited = either.before[number] + b"# mine\n"
    path.write_bytes(edited)
    with pytest.raises(FileError, match=r"changed since the run began.*run again") as caught:
        either.commit(tmp_path / "run")
    assert not (tmp_path / "run").exists()
    assert caught.value.subject == str(path)
    assert path.read_bytes() == edited
    either.reset(tmp_path)
    receipt = either.commit(tmp_path / "run")
    path.write_bytes(edited)
    with pytest.raises(FileError, match="changed since it was written") as caught:
        rollback(receipt)
    assert caught.value.subject == str(path)
    assert str(receipt.kept(BEFORE)[number]) in str(caught.value)


@pytest.mark.parametrize("number", [0, -1])
def test_a_file_that_is_not_there_is_named(either: Bench, tmp_path: Path, number: int) -> None:
    either.files[number].unlink()
    for job in (lambda: either.commit(tmp_path / "run"), lambda: either.layout.read(*either.files)):
        with pytest.raises(HexacellError, match=rf"{either.files[number].name}: cannot be read"):
            job()
    others = set(range(len(either.files))) - {number % len(either.files)}
    assert all(either.files[one].read_bytes() == either.before[one] for one in others)


def test_a_change_by_another_program_between_the_two_is_kept(bench, tmp_path, monkeypatch) -> None:
    """The first file is replaced; before the second one is, somebody saves it in an editor."""
    real, target = os.replace, bench.files[1].resolve()

    def replace(source: Any, to: Any) -> None:
        real(source, to)
        if Path(to) == bench.files[0]:
            target.write_bytes(b"[MINE]\n")

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(WriteBackUndone, match="changed by somebody else"):
        bench.commit(tmp_path / "run")
    assert bench.found == (bench.before[0], b"[MINE]\n")


def test_a_lost_copy_of_one_file_is_a_damaged_backup(either: Bench, tmp_path: Path) -> None:
    receipt = either.commit(tmp_path / "run")
    receipt.kept(BEFORE)[-1].write_bytes(b"another")
    with pytest.raises(FileError, match="the backup is damaged"):
        rollback(receipt)
    assert either.found == either.after
