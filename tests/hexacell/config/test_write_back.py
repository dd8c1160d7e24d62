"""A commit into a single file, and its rollback: what is written, kept and refused."""

import os
from pathlib import Path

import pytest

from hexacell.config import write_back
from hexacell.config import write_back as replacement
from hexacell.config.change import ConfigChange, Receipt, propose
from hexacell.config.layout import fingerprint
from hexacell.config.toml_format import NativeToml
from hexacell.config.write_back import commit, rollback
from hexacell.errors import FileError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from tests.native_config import NATIVE


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.fixture
def proposal(config: Path, geometry: Geometry) -> ConfigChange:
    return propose((config,), NATIVE, geometry, fingerprint_at_start=fingerprint(config))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return tmp_path / "runs" / "0001"


def test_a_commit_writes_what_was_proposed(
    config: Path, run: Path, geometry: Geometry, proposal: ConfigChange
) -> None:
    config.chmod(0o640)
    commit(proposal, run)
    assert config.read_bytes() == proposal.text_after.encode()
    assert NativeToml(HEXAGLIDE_PARAMETERS).read(config).geometry.largest_difference(geometry) <= 5e-7
    assert config.stat().st_mode & 0o777 == 0o640
    assert names(config.parent) == [config.name]


def test_rollback_works_from_a_moved_run_folder(config: Path, run: Path, proposal: ConfigChange) -> None:
    commit(proposal, run)
    run.rename(run.parent / "archived")
    rollback(Receipt.of(run.parent / "archived"))
    assert config.read_bytes() == proposal.text_before.encode()


def test_a_config_that_changes_in_the_last_moment_is_left_alone(
    config: Path, run: Path, proposal: ConfigChange, monkeypatch: pytest.MonkeyPatch
) -> None:
    def back_up_slowly(*args: object) -> None:
        config.write_bytes(b"somebody's new work")

    monkeypatch.setattr(write_back, "_back_up", back_up_slowly)
    with pytest.raises(FileError, match="changed by somebody else"):
        commit(proposal, run)
    assert config.read_bytes() == b"somebody's new work"
    assert names(config.parent) == [config.name]


def test_a_commit_interrupted_after_the_replacement_is_recognised(
    config: Path, run: Path, proposal: ConfigChange
) -> None:
    receipt = commit(proposal, run)
    assert commit(proposal, run) == receipt
    with pytest.raises(FileError, match="changed since the run began"):
        commit(proposal, run.parent / "another run")


def test_a_backup_of_another_version_is_not_overwritten(
    config: Path, run: Path, proposal: ConfigChange
) -> None:
    run.mkdir(parents=True)
    (run / "config-before").write_bytes(b"precious")
    with pytest.raises(FileError, match="backup of another version"):
        commit(proposal, run)
    assert (run / "config-before").read_bytes() == b"precious"
    assert config.read_bytes() == proposal.text_before.encode()


def test_a_deleted_config_is_not_brought_back(config: Path, run: Path, proposal: ConfigChange) -> None:
    receipt = commit(proposal, run)
    config.unlink()
    with pytest.raises(FileError, match="does not exist"):
        rollback(receipt)
    assert not config.exists()


def test_a_config_that_does_not_read_back_is_restored(
    config: Path, run: Path, proposal: ConfigChange, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that garbles the config: the backup is restored, and the garbled file is kept."""
    replace = os.replace

    def garble(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(target) == config and config.read_bytes() == proposal.text_after.encode():
            config.write_bytes(b"garbled")

    monkeypatch.setattr(os, "replace", garble)
    with pytest.raises(WriteBackUndone, match="does not contain what was written") as caught:
        commit(proposal, run)
    assert caught.value.exit_code == 6
    assert config.read_bytes() == proposal.text_before.encode()
    [kept] = run.glob("config-found-*")
    assert kept.read_bytes() == b"garbled"


def test_an_interrupt_after_the_replacement_is_undone_and_stays_an_interrupt(
    config: Path, run: Path, proposal: ConfigChange, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(path: Path, expected: bytes) -> None:
        if expected == proposal.text_after.encode():
            raise KeyboardInterrupt

    monkeypatch.setattr(replacement, "require_written", interrupt)
    with pytest.raises(KeyboardInterrupt):
        commit(proposal, run)
    assert config.read_bytes() == proposal.text_before.encode()


def test_a_backup_that_does_not_read_back_stops_the_commit(
    config: Path, run: Path, proposal: ConfigChange, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = os.replace

    def garble(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(target).name == "config-before":
            Path(target).write_bytes(b"garbled")

    monkeypatch.setattr(os, "replace", garble)
    with pytest.raises(FileError, match="backup is damaged"):
        commit(proposal, run)
    assert config.read_bytes() == proposal.text_before.encode()
