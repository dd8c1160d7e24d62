"""What a command writes takes the place of nothing that the same option did not write before."""

import argparse
import os
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from hexacell.cli.arguments import make_parser
from hexacell.errors import FileError
from hexacell.runs.archive import INDEX
from hexacell.services.history.past_runs import KeptFor, delete_runs, past_runs, retention
from hexacell.storage.atomic_files import write_own
from hexacell.storage.output_files import EVENTS, LOG, METRICS, REPORT, OutputFile
from tests.hexacell.services.proposed_runs import propose_run

READ = {
    "devices --answers",
    "devices --cell",
    "fit --measurements",
    "next --measurements",
    "report --compare",
}
"""Options that name files or folders which are read."""

FOLDERS = {"demo --folder", "host --folder", "replay --export", "schedule --folder", "study --folder"}
"""Options that name folders to write into; tests below, or those of the command, say what they refuse."""

ARGUMENTS = dict.fromkeys(("run", "simulate", "status"), ("CELL",)) | {
    "report": ("RUN",),
    "view": ("CELL", "--no-open"),
    "schedule": ("CELL", "--daily", "02:30"),
    "devices": (),
}
"""What else a command with an output is given."""


Option = tuple[str, str, object]


def options_with_paths(parser: argparse.ArgumentParser, path: str = "") -> Iterator[Option]:
    """Command, option and value of every option that names a file or a folder."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                yield from options_with_paths(command, f"{path} {name}".strip())
        elif action.option_strings:
            named: object = "x"
            with suppress(ValueError, ArithmeticError):
                named = action.type("x") if callable(action.type) else "x"
            if action.metavar in {"FILE", "FOLDER"} or isinstance(named, Path | OutputFile):
                yield path, action.option_strings[0], named


OPTIONS = sorted(options_with_paths(make_parser()), key=str)
OUTPUTS = [one[:2] for one in OPTIONS if isinstance(one[2], OutputFile) and one[1] != "--log-file"]


def test_every_option_that_names_a_file_to_write_is_known_as_one() -> None:
    """A new option is declared by ``add_output``, or is added to those that read."""
    for command, option, named in OPTIONS:
        words = f"{command.split()[0]} {option}"
        assert isinstance(named, OutputFile) or words in FOLDERS | READ, words
    assert {command for command, _ in OUTPUTS} == set(ARGUMENTS)


@pytest.mark.parametrize(("command", "option"), [*OUTPUTS, ("status", "--log-file")])
def test_no_output_replaces_a_cell_a_config_a_journal_or_a_note(
    command: str, option: str, cell_folder, typed_here, demo, run, tmp_path, never_moves
) -> None:
    note, link, nothing = tmp_path / "note.pdf", tmp_path / "link", tmp_path / "nothing"
    note.write_text("precious")
    link.symlink_to(cell_folder.controller)
    nothing.symlink_to(tmp_path / "absent")
    copied = Path(shutil.copy(run / "journal.jsonl", tmp_path / "copied.jsonl"))
    places = {"CELL": cell_folder.cell, "RUN": run}
    given = [places.get(one, one) for one in ARGUMENTS[command]]
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    theirs = (cell_folder.cell, cell_folder.controller, run / "journal.jsonl", run / "result.json")
    for target in (*theirs, copied, note, link, nothing):
        outcome = typed_here(command, *given, option, target)
        assert (outcome.code, target.name in outcome.err) == (2, True), (target, outcome.err)
    if command == "schedule":
        assert typed_here(command, *given, "--folder", run).code == 2
    assert {path: path.read_bytes() for path in before} == before
    assert not (tmp_path / "absent").exists()


def test_what_an_option_wrote_before_it_writes_again(tmp_path) -> None:
    event, line = b' {"n":1,"version":1,"at":"2026-', b"2026-11-27T00:00:00.000Z INFO hexacell: x"
    for kind, text, lines in ((EVENTS, event, 1), (LOG, line, 2)):
        output = OutputFile(tmp_path / kind.noun, kind)
        for _ in range(2):
            with os.fdopen(output.open_stream(appends=kind is LOG), "wb") as stream:
                stream.write(text + b"\n")
        assert len(output.path.read_bytes().splitlines()) == lines
    (tmp_path / "kept").hardlink_to(tmp_path / EVENTS.noun)
    with pytest.raises(FileError, match="another name"):
        OutputFile(tmp_path / EVENTS.noun, EVENTS).open_stream()
    linked = tmp_path / "linked.prom"
    linked.symlink_to(tmp_path / "cell.prom")
    (tmp_path / "cell.prom").touch()
    for text in (b"# HELP hexacell_a\n", b"# HELP hexacell_b\n"):
        OutputFile(linked, METRICS).write(text)
    assert (linked.is_symlink(), linked.read_bytes()) == (True, text)


def test_a_report_is_made_again_and_goes_through_no_link(typed_here, run, cell_folder, tmp_path) -> None:
    for name in ("r.html", "r.pdf"):
        for _ in range(2):
            assert typed_here("report", run, "--output", tmp_path / name).code == 0
    before = cell_folder.controller.read_bytes()
    (run / "report.html").symlink_to(cell_folder.controller)
    refused = typed_here("report", run)
    assert (refused.code, "is a link" in refused.err) == (2, True)
    assert cell_folder.controller.read_bytes() == before


def test_an_empty_lock_is_nobodys_to_replace(tmp_path) -> None:
    lock = tmp_path / ".robot.toml.hexacell-lock"
    lock.touch()
    with pytest.raises(FileError, match="left as it is"):
        OutputFile(lock, METRICS).require()
    (tmp_path / "journal.jsonl").touch()
    with pytest.raises(FileError, match="folder of a run"):
        OutputFile(tmp_path / "new", METRICS).require()
    OutputFile(tmp_path / "new.html", REPORT).require()


def test_a_file_of_its_own_is_written_through_no_link(tmp_path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "absent")
    with pytest.raises(FileError, match="is a link"):
        write_own(tmp_path / "link", b"x")
    assert not (tmp_path / "absent").exists()


@pytest.mark.parametrize(("name", "content"), [("paper.svg", "<svg/>"), ("paper.jsonl", "precious")])
def test_a_folder_keeps_what_no_study_or_demo_made(typed_here, tmp_path, name, content: str) -> None:
    theirs, kept = tmp_path / name, tmp_path / "kept"
    theirs.write_text(content)
    assert typed_here("study", "paper", "--draws", "1", "--folder", tmp_path).code == 2
    theirs.rename(kept)
    for link in (theirs, tmp_path / ".hexacell-demo"):
        link.symlink_to(kept)
    assert typed_here("study", "paper", "--draws", "1", "--folder", tmp_path).code == 2
    assert typed_here("demo", "--folder", tmp_path).code == 2
    assert kept.read_text() == content


def test_an_index_that_is_a_link_makes_no_file_and_the_runs_are_listed(cell, typed_here, tmp_path) -> None:
    run = propose_run(cell)
    (run.folder.siblings / INDEX).symlink_to(tmp_path / "absent")
    listed = typed_here("history", cell.path, "--json")
    assert [one["run"] for one in listed.document["runs"]] == [str(run.folder.path)]
    assert f"{INDEX}: is a link" in listed.err
    assert not (tmp_path / "absent").exists()


def test_a_run_whose_folder_is_a_link_is_never_deleted(cell, tmp_path) -> None:
    run = propose_run(cell)
    run.folder.proposal.unlink()
    moved = tmp_path / "moved"
    run.folder.path.rename(moved)
    run.folder.path.symlink_to(moved)
    found = retention(cell, 0.0)
    assert (found.leaving, [reason for _, reason in found.kept]) == ((), [KeptFor.LINKED])
    (run.folder.siblings / ".leaving-half").symlink_to(moved)
    delete_runs(cell, past_runs(cell))
    assert run.folder.journal.is_file()
    assert not (run.folder.siblings / ".leaving-half").is_symlink()
