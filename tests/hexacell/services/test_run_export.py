"""A run is kept without passwords, and the copy of an older one has none either."""

from __future__ import annotations

import shutil
from dataclasses import replace
from typing import Any

import pytest

from hexacell.errors import UsageError
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.run_export import export_run
from hexacell.services.run.replay_run import replay
from procedures.journal.journal import read_entries, read_version
from procedures.journal.line_format import encode
from procedures.replay.replayer import Scope

CLEAR = '[controller]\nconnect_password = "hunter2"\n'


@pytest.fixture
def old_run(finished, tmp_path):
    """A run of a version that kept the cell file as it was, with what may lie around in its folder."""
    run = RunFolder(tmp_path / "run")
    shutil.copytree(finished.folder.path, run.path)
    entries = list(read_entries(run.journal))
    started: Any = entries[0].event
    text = started.cell_text.replace("[controller]\n", CLEAR)
    assert CLEAR in text
    entries[0] = replace(entries[0], event=started.model_copy(update={"cell_text": text}))
    run.journal.write_bytes(b"".join(map(encode, entries)))
    (run.path / "cell.toml").write_text(text)
    for name in ("config-before", "config-after"):
        with (run.path / name).open("a") as config:
            config.write('\n[remote]\nsecret = "hunter2"\n')
    hello = b"hello hunter2 hexacell\r\n"
    with run.wire.open("a") as wire:
        wire.write(f"1.0 controller 127.0.0.1:5007 > {hello.hex(' ')}  hello hunter2 hexacell..\n")
        wire.write(f"1.0 controller 127.0.0.1:5007 > {b'set enable ***TOO'.hex(' ')}  set enable ***TOO\n")
    (run.path / "notes").write_text("hunter2")
    (run.path / "wire-2").symlink_to(run.path / "notes")
    return run


async def test_an_export_has_no_password_and_is_the_same_run(old_run, tmp_path) -> None:
    target = tmp_path / "copies" / "export"
    names = export_run(old_run.path, target)
    copied = {
        str(path.relative_to(target)): path.read_bytes() for path in target.rglob("*") if path.is_file()
    }
    assert set(copied) == set(names)
    assert set(names) >= {
        "journal.jsonl",
        "cell.toml",
        "wire",
        "proposal.json",
        "config-before",
        "result.json",
    }
    assert "notes" not in names
    assert "wire-2" not in names
    for name, data in copied.items():
        assert b"hunter" not in data, name
        assert b"hunter2".hex(" ").encode() not in data, name
        assert b"TOO" not in data, name
    assert copied["measurements.csv"] == old_run.measurements.read_bytes()
    lines = copied["journal.jsonl"].splitlines()
    assert lines[1:] == old_run.journal.read_bytes().splitlines()[1:]
    assert read_version(target / "journal.jsonl") == read_version(old_run.journal)
    assert (await replay(target, Scope.RESULTS)).is_same


async def test_a_folder_with_something_in_it_is_not_written_to(old_run, tmp_path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "file").touch()
    with pytest.raises(UsageError, match="something is there already"):
        export_run(old_run.path, tmp_path / "there")
    assert [path.name for path in (tmp_path / "there").iterdir()] == ["file"]


async def test_a_secret_in_the_controllers_config_is_masked_in_the_proposal(old_run, tmp_path) -> None:
    text = old_run.proposal.read_text()
    change = replace_texts(text)
    old_run.proposal.write_bytes(change)
    export_run(old_run.path, tmp_path / "export")
    assert b"hunter" in change
    assert b"hunter" not in (tmp_path / "export" / "proposal.json").read_bytes()
    shutil.rmtree(tmp_path / "export" / "lent", ignore_errors=True)
    (tmp_path / "export" / "config-before").unlink()
    assert (await replay(tmp_path / "export", Scope.IDENTIFICATION)).is_same


def replace_texts(proposal: str) -> bytes:
    from hexacell.config.change import ConfigChange
    from hexacell.storage.atomic_files import sha256

    change = ConfigChange.model_validate_json(proposal)
    more = '\n[remote]\nsecret = "hunter2"\n'
    before, after = change.text_before + more, change.text_after + more
    update = {
        "text_before": before,
        "text_after": after,
        "sha256_before": sha256(before.encode()),
        "sha256_after": sha256(after.encode()),
    }
    return change.model_copy(update=update).to_json()
