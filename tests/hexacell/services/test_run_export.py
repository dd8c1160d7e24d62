"""The copy of a run has no secrets, and is the same run."""

import shutil

import pytest

from hexacell.config.change import ConfigChange
from hexacell.runs.run_folder import RunFolder
from hexacell.services.history.run_export import export_run
from hexacell.services.run.replay_run import replay
from hexacell.storage.atomic_files import sha256
from procedures.replay.replayer import Scope

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
