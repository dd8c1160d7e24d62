"""A change of a file, its commit and its rollback, also with a fault at every call to the file system."""

import json
import math
import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.config import write_back
from hexacell.config.change import ConfigChange, Receipt, diff, propose
from hexacell.config.layout import fingerprint
from hexacell.config.pending_write import is_interrupted, note_write, settle_interrupted_write
from hexacell.config.write_back import commit, rollback
from hexacell.errors import FileError, WriteBackUndone
from hexacell.kinematics.geometry import Geometry
from hexacell.storage import atomic_files
from tests.hexacell.config.conftest import Bench, PowerCut
from tests.native_config import NATIVE


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return tmp_path / "runs" / "0001"


def test_rollback_works_from_a_moved_run_folder(config: Path, run: Path, proposal: ConfigChange) -> None:
    commit(proposal, run)
    run.rename(run.parent / "archived")
    rollback(Receipt.of(run.parent / "archived"))
    assert config.read_bytes() == proposal.text_before.encode()


def test_a_config_that_changes_in_the_last_moment_is_left_alone(config, run, proposal, monkeypatch) -> None:
    def back_up_slowly(*args: object) -> None:
        config.write_bytes(b"somebody's new work")

    monkeypatch.setattr(write_back, "_back_up", back_up_slowly)
    with pytest.raises(FileError, match="changed by somebody else"):
        commit(proposal, run)
    assert config.read_bytes() == b"somebody's new work"
    assert list(config.parent.iterdir()) == [config]


def test_a_backup_of_another_version_is_not_overwritten(config, run, proposal) -> None:
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


@pytest.fixture
def garbles(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path, bytes], None]:
    """A disk that garbles a file once some content is in it."""

    def garble(path: Path, content: bytes) -> None:
        def replace(source: Path, target: Path, real: Callable[[Path, Path], None] = os.replace) -> None:
            real(source, target)
            if Path(target) == path and path.read_bytes() == content:
                path.write_bytes(b"garbled")

        monkeypatch.setattr(os, "replace", replace)

    return garble


def test_a_config_that_does_not_read_back_is_restored(config, run, proposal, garbles) -> None:
    """From the backup; the garbled file is kept."""
    garbles(config, proposal.text_after.encode())
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

    monkeypatch.setattr(write_back, "require_written", interrupt)
    with pytest.raises(KeyboardInterrupt):
        commit(proposal, run)
    assert config.read_bytes() == proposal.text_before.encode()


def test_a_backup_that_does_not_read_back_stops_the_commit(config, run, proposal, garbles) -> None:
    garbles(run / "config-before", proposal.text_before.encode())
    with pytest.raises(FileError, match="backup is damaged"):
        commit(proposal, run)
    assert config.read_bytes() == proposal.text_before.encode()


def test_any_single_failure_of_a_commit_leaves_the_old_config(either: Bench) -> None:
    undone = 0
    for name, _, raised in either.attempts(either.reset, either.commit):
        assert either.found == (either.after if raised is None else either.before), name
        settle_interrupted_write(either.files)  # a note may be left of what is undone
        assert either.found == (either.after if raised is None else either.before), name
        assert either.left_behind() == [], name
        undone += isinstance(raised, WriteBackUndone)
    assert undone >= 4 * len(either.files)  # the folder cannot be opened or synced; the file not be read


@pytest.mark.sample("one-*", "two-inf")
@pytest.mark.parametrize("width", [2, 5, math.inf])
def test_consecutive_failures_leave_what_the_message_says_or_what_is_undone_next(either, width) -> None:
    kept, halves = ["config-before", "config-before-2"][: len(either.files)], 0
    for name, run, raised in either.attempts(either.reset, either.commit, width=width):
        if raised is None:
            assert either.found == either.after, name
        elif "may hold the new geometry" in str(raised):
            halves += either.found != either.before
            assert " and ".join(str(run / one) for one in kept) in str(raised), name
        else:
            assert either.found == either.before, name
        settle_interrupted_write(either.files)
        assert not either.is_mixed, name
    assert halves or math.isfinite(width)


@pytest.mark.sample("one-*", "two-commit")
@pytest.mark.parametrize("job", ["commit", "rollback"])
def test_a_power_cut_at_any_moment_is_settled(either: Bench, job: str) -> None:
    doing, prepare = {
        "commit": (either.commit, either.reset),
        "rollback": (lambda run: rollback(Receipt.of(run)), either.commit_afresh),
    }[job]
    mixed, ends = 0, set()
    for name, run, raised in either.attempts(prepare, doing, width=math.inf, error=PowerCut):
        assert isinstance(raised, PowerCut), name
        if was_mixed := either.is_mixed:
            assert is_interrupted(either.files), name
        settled = settle_interrupted_write(either.files)
        assert not either.is_mixed, name
        assert not is_interrupted(either.files), name
        if was_mixed:
            assert settled is not None, name
            assert settled.endswith("between them: hexapod.hal got the old content back"), name
        mixed += was_mixed
        ends.add(either.found)
        doing(run)  # whatever was left, it can be done again
        assert either.found == (either.after if job == "commit" else either.before), name
        rollback(Receipt.of(run))
        assert either.found == either.before, name
    assert ends == {either.before, either.after}
    assert bool(mixed) is (len(either.files) > 1)


@pytest.mark.sample("one-*")
@pytest.mark.parametrize("width", [1, math.inf])
def test_a_rollback_that_fails_leaves_one_of_both_and_can_be_repeated(either: Bench, width: float) -> None:
    for name, run, raised in either.attempts(
        either.commit_afresh, lambda run: rollback(Receipt.of(run)), width=width
    ):
        if len(either.files) == 1 and raised is not None and either.found == either.before:
            assert "was replaced" in str(raised) or "cannot be read" in str(raised), name
        settle_interrupted_write(either.files)
        assert not either.is_mixed, name
        rollback(Receipt.of(run))
        assert either.found == either.before, name


def test_what_is_settled_can_itself_be_cut_off(bench: Bench) -> None:
    def half(run: object) -> None:
        note_write(bench.files, bench.before, bench.after)
        bench.files[0].write_bytes(bench.after[0])
        bench.files[1].write_bytes(bench.before[1])

    for name, _, _ in bench.attempts(
        half, lambda _: settle_interrupted_write(bench.files), width=math.inf, error=PowerCut
    ):
        settle_interrupted_write(bench.files)
        assert bench.found == bench.before, name


def test_a_proposal_describes_the_change_and_writes_nothing(config, geometry, proposal) -> None:
    text = config.read_bytes()
    assert proposal.path == config
    assert proposal.sha256_before == atomic_files.sha256(text) == fingerprint(config)
    assert proposal.text_before.encode() == text
    assert proposal.before["l"] == (700.0,) * 6
    assert proposal.after["S"][1] == tuple(geometry["S"][1])
    assert "-\t[-400.0, 200, 0.0]," in proposal.diff
    assert "+\t[-399.996296, 200.004938, 0.006173]," in proposal.diff
    assert "gain" not in proposal.diff


def test_a_config_that_changed_since_the_run_began_is_refused(config: Path, geometry: Geometry) -> None:
    start = fingerprint(config)
    config.write_text(config.read_text() + "# one more remark\n")
    with pytest.raises(FileError, match=r"changed since the run began.*run again"):
        propose((config,), NATIVE, geometry, fingerprint_at_start=start)


def test_a_proposal_survives_its_file_with_windows_line_ends_and_a_byte_order_mark(
    tmp_path: Path, config: Path, geometry: Geometry
) -> None:
    config.write_bytes(b"\xef\xbb\xbf" + config.read_bytes().replace(b"\n", b"\r\n"))
    made = propose((config,), NATIVE, geometry, fingerprint_at_start=fingerprint(config))
    made.save(tmp_path / "proposal.json")
    loaded = ConfigChange.load(tmp_path / "proposal.json")
    assert loaded == made
    assert loaded.text_before.encode() == config.read_bytes()


@pytest.mark.parametrize("key", ["text_before", "text_after", "sha256_before", "sha256_after"])
def test_an_edited_proposal_is_refused(tmp_path: Path, proposal: ConfigChange, key: str) -> None:
    path = tmp_path / "proposal.json"
    document = json.loads(proposal.to_json())
    path.write_text(json.dumps(document | {key: document[key] + " "}))
    with pytest.raises(FileError, match="does not have the checksum stated"):
        ConfigChange.load(path)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"version": 2}'])
def test_a_file_that_is_no_proposal_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "proposal.json"
    path.write_text(text)
    with pytest.raises(FileError, match="this is not a config change") as caught:
        ConfigChange.load(path)
    assert caught.value.subject == str(path)


pieces = st.lists(st.sampled_from(["a\n", "b\r\n", "c\f d\n", "e\x85\u2028\n", "\n"]), max_size=8).map(
    "".join
)
texts = st.tuples(pieces, st.sampled_from(["", "no end of line"])).map("".join)


def patched(before: str, change: str) -> str:
    """``before`` with a unified diff applied, as ``patch`` does it but by the book."""
    old = re.findall(r"[^\n]*\n|[^\n]+$", before)
    lines = re.findall(r"[^\n]*\n", change.replace("\n\\ No newline at end of file\n", "\0\n"))
    new, done = [], 0
    for line in (line.replace("\0\n", "") for line in lines[2:]):
        if hunk := re.match(r"@@ -(\d+)(,0)?", line):
            start = int(hunk[1]) - (0 if hunk[2] else 1)
            new += old[done:start]
            done = start
        elif line.startswith("+"):
            new.append(line[1:])
        else:
            assert old[done] == line[1:]
            new += [old[done]] if line.startswith(" ") else []
            done += 1
    return "".join(new + old[done:])


@given(texts, texts)
def test_the_diff_is_the_whole_change(before: str, after: str) -> None:
    assert patched(before, diff(before, after)) == after
