"""The copy of a run has no secrets, and is the same run."""

from __future__ import annotations

import shutil

import pytest

from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.run_export import export_run
from hexacell.services.run.replay_run import replay
from procedures.replay.replayer import Scope

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
            config.write('\n[remote]\nsecret = "hunter2"\n')
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
    assert copied["measurements.csv"] == untidy_run.measurements.read_bytes()
    assert copied["journal.jsonl"] == untidy_run.journal.read_bytes()
    assert (await replay(target, Scope.RESULTS)).is_same


async def test_a_secret_in_the_controllers_config_is_masked_in_the_proposal(untidy_run, tmp_path) -> None:
    text = untidy_run.proposal.read_text()
    change = replace_texts(text)
    untidy_run.proposal.write_bytes(change)
    export_run(untidy_run.path, tmp_path / "export")
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
