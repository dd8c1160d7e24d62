"""A replay, also of an exported run, gives the same decisions; differences are told, secrets are gone."""

import shutil
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hexacell.config.change import ConfigChange
from hexacell.errors import ExitCode, FileError
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.run_export import export_run
from hexacell.services.run.replay_run import replay
from hexacell.storage.atomic_files import sha256
from procedures.journal.journal import Entry, encode, read_entries
from procedures.replay.replayer import Aspect, Scope
from procedures.steps import events


def recorded(finished: Any) -> list[Any]:
    return list(read_entries(finished.folder.journal))


def write(path: Path, entries: Iterable[Entry]) -> Path:
    path.write_bytes(b"".join(map(encode, entries)))
    return path


def with_beginning(entries: list[Any], **changes: Any) -> list[Entry]:
    started = entries[0].event.model_copy(update=changes)
    return [replace(entries[0], event=started), *entries[1:]]


def everything_in(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


async def test_the_replay_of_a_run_has_no_differences(finished, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = everything_in(finished.cell.path.parent)
    replayed = await replay(finished.folder.path)
    assert replayed.is_same
    assert replayed.differences == []
    assert replayed.events == len(finished.history)
    assert replayed.decisions == sum(isinstance(e, events.StepBegun) for e in finished.history)
    assert everything_in(finished.cell.path.parent) == before
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"


async def test_a_journal_alone_is_replayed(finished, tmp_path) -> None:
    journal = shutil.copy(finished.folder.journal, tmp_path / "sent-by-mail")
    replayed = await replay(Path(journal), Scope.RESULTS)
    assert replayed.is_same
    assert {event.kind for event in finished.history} >= {"proposed", "committed"}
    assert replayed.results > 60


async def test_the_replay_of_a_manipulated_journal_has_a_difference(finished, tmp_path) -> None:
    entries = recorded(finished)
    place = next(n for n, entry in enumerate(entries) if isinstance(entry.event, events.Identified))
    identified = entries[place].event
    result = identified.result.model_copy(update={"chi2": identified.result.chi2 + 1e-6})
    entries[place] = replace(entries[place], event=identified.model_copy(update={"result": result}))
    path = write(tmp_path / "journal.jsonl", entries)
    replayed = await replay(path, Scope.IDENTIFICATION)
    assert not replayed.is_same
    [difference] = replayed.differences
    assert (difference.line, difference.change.field) == (place + 1, "result.chi2")
    assert (await replay(path, Scope.IDENTIFICATION, tolerance=1e-5)).is_same


async def test_different_decisions_of_another_version_are_reported_and_accepted(finished, tmp_path) -> None:
    entries = recorded(finished)
    places = [n for n, entry in enumerate(entries) if isinstance(entry.event, events.StepBegun)]
    del entries[places[12] :]
    begun = entries[places[5]].event
    step = begun.step.model_copy(update={"orientation": 7})
    entries[places[5]] = replace(entries[places[5]], event=begun.model_copy(update={"step": step}))
    path = write(tmp_path / "journal.jsonl", entries)
    other = with_beginning(entries, software="hexacell 0.0.9")
    replayed = await replay(write(path, other), Scope.DECISIONS)
    [difference] = replayed.differences
    assert difference.aspect is Aspect.DECISION
    assert replayed.is_same, "a difference that is reported and does not count"


async def test_a_journal_without_beginning_is_refused(tmp_path) -> None:
    (tmp_path / "journal.jsonl").touch()
    with pytest.raises(FileError, match="no start") as refusal:
        await replay(tmp_path)
    assert refusal.value.exit_code is ExitCode.USAGE


async def test_a_cell_file_of_another_version_is_refused_by_name(finished, tmp_path) -> None:
    entries = recorded(finished)
    text = entries[0].event.cell_text.replace("version = 1", "version = 9")
    journal = write(tmp_path / "journal.jsonl", with_beginning(entries, cell_text=text))
    with pytest.raises(FileError, match="this version cannot read the cell file") as refusal:
        await replay(journal)
    assert refusal.value.subject == str(journal)
    assert refusal.value.action == f"Replay it with {entries[0].event.software}"


MORE = '\n[remote]\nsecret = "hunter2"\n'
CLEAR = '[controller]\nconnect_password = "hunter2"\n'


@pytest.fixture
def untidy_run(finished, tmp_path):
    """A run with secrets in its configs, and with what may lie around in its folder."""
    run = RunFolder(tmp_path / "run")
    shutil.copytree(finished.folder.path, run.path)
    cell = run.path / "cell.toml"
    cell.write_text(cell.read_text().replace("[controller]\n", CLEAR))
    assert CLEAR in cell.read_text()
    for name in ("config-before", "config-after"):
        with (run.path / name).open("a") as config:
            config.write(MORE)
    proposal = ConfigChange.load(run.proposal)
    secret = {"text_before": proposal.text_before + MORE, "text_after": proposal.text_after + MORE}
    sums = {name.replace("text", "sha256"): sha256(text.encode()) for name, text in secret.items()}
    run.proposal.write_bytes(proposal.model_copy(update=secret | sums).to_json())
    assert b"hunter" in run.proposal.read_bytes()
    run.wire.write_text("1.0 controller 127.0.0.1:5007 > 68 69  hi\n")
    (run.path / "notes").write_text("hunter2")
    (run.path / "wire-2").symlink_to(run.path / "notes")
    return run


async def test_an_export_has_no_password_and_is_the_same_run(untidy_run, tmp_path) -> None:
    target = tmp_path / "copies" / "export"
    names = export_run(untidy_run.path, target)
    copied = {
        str(path.relative_to(target)): path.read_bytes() for path in target.rglob("*") if path.is_file()
    }
    kept = {"journal.jsonl", "cell.toml", "wire", "proposal.json", "config-before", "result.json"}
    assert set(copied) == set(names) >= kept
    assert not {"notes", "wire-2"} & set(names)
    for name, data in copied.items():
        assert b"hunter" not in data, name
    assert copied["measurements.csv"] == untidy_run.measurements.read_bytes()
    assert copied["journal.jsonl"] == untidy_run.journal.read_bytes()
    assert (await replay(target, Scope.RESULTS)).is_same
