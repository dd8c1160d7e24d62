"""What a run tells beside its output: the journal's lines for another program, and the log of a command."""

import os
import re
import threading

import pytest

from procedures.journal.journal import read_entries

CHECK = ("--mode", "check", "--unattended")
SHORT = ("budget_records = 40", "budget_records = 4")


def test_each_event_is_a_line_as_in_the_journal(typed_here, quick_cell, few_candidates, tmp_path) -> None:
    target = tmp_path / "events.jsonl"
    target.write_text(' {"n":1,"version":1,"at":"of yesterday"}\n')
    quick_cell.edit(SHORT)
    typed_here("run", quick_cell.cell, *CHECK, "--events", target)
    written = b"".join(b" " + (run / "journal.jsonl").read_bytes() for run in quick_cell.runs())
    assert target.read_bytes() == written
    assert len(written.splitlines()) > 50


def test_where_no_events_can_be_written_nothing_moves(typed_here, quick_cell, tmp_path) -> None:
    os.mkfifo(tmp_path / "pipe")
    refused = {"pipe": "nobody reads this pipe", "nowhere/events": "events cannot be written"}
    for target, words in refused.items():
        outcome = typed_here("run", quick_cell.cell, *CHECK, "--events", tmp_path / target)
        assert (outcome.code, words in outcome.err) == (2, True)
    assert quick_cell.runs() == []


@pytest.mark.slow
def test_a_reader_that_leaves_does_not_end_the_run(typed_here, quick_cell, few_candidates, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    quick_cell.edit(SHORT)
    ready = threading.Event()

    def read_one_line() -> None:
        descriptor = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        ready.set()
        os.set_blocking(descriptor, True)
        opened.wait()
        os.read(descriptor, 10)
        os.close(descriptor)

    opened = threading.Event()
    reader = threading.Thread(target=read_one_line)
    reader.start()
    ready.wait()
    holder = os.open(pipe, os.O_WRONLY)  # until the run has opened it, the reader would see its end
    opened.set()
    try:
        outcome = typed_here("run", quick_cell.cell, *CHECK, "--events", pipe)
    finally:
        os.close(holder)
        reader.join()
    assert "pipe: no more events are written there: Broken pipe" in outcome.err
    assert read_entries(quick_cell.runs()[0] / "journal.jsonl")[-1].event.kind == "ended"


LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z (DEBUG|INFO|WARNING|ERROR) [\w.]+: .+")


def test_a_file_gets_a_line_for_what_was_done(typed_here, quick_cell, tmp_path) -> None:
    file = tmp_path / "hexacell.log"
    for _ in range(2):
        assert typed_here("status", quick_cell.cell, "--log-file", file).err == ""
    lines = file.read_text().splitlines()
    assert all(LINE.fullmatch(line) for line in lines)
    assert len([line for line in lines if "INFO hexacell.cell.loader: read the cell file" in line]) == 2
    assert lines[-1].endswith("INFO hexacell.cli.app: exit code 0")
    assert "DEBUG" not in file.read_text()


def test_verbose_logs_on_stderr_and_twice_in_detail(typed_here, quick_cell) -> None:
    once = typed_here("cell", "validate", quick_cell.cell, "-v").err
    twice = typed_here("cell", "validate", quick_cell.cell, "-vv").err
    assert ("INFO hexacell.cell.loader" in once, "DEBUG" in once) == (True, False)
    assert "DEBUG hexacell.plugins: encoder protocol 'cia406' is" in twice


def test_a_failure_and_a_fault_are_logged(typed_here, quick_cell, tmp_path, monkeypatch) -> None:
    file = tmp_path / "hexacell.log"
    assert typed_here("status", tmp_path / "no.toml", "--log-file", file).code == 2
    assert "ERROR hexacell.cli.app: exit code 2: " in file.read_text()
    monkeypatch.setattr("hexacell.services.history.cell_status.cell_status", None)
    assert typed_here("status", quick_cell.cell, "--log-file", file).code == 70
    assert "TypeError: 'NoneType' object is not callable" in file.read_text()


def test_a_log_that_cannot_be_written_is_refused(typed_here, quick_cell, tmp_path) -> None:
    outcome = typed_here("status", quick_cell.cell, "--log-file", tmp_path)
    assert (outcome.code, outcome.out) == (2, "")
    assert "the log cannot be written: Is a directory" in outcome.err
    assert typed_here("status", quick_cell.cell, "--log-file", "/dev/full").code == 0
    outcome = typed_here("tui", quick_cell.cell, "-v")
    assert (outcome.code, "Name a file: --log-file FILE" in outcome.err) == (2, True)


def test_the_file_may_be_named_in_the_environment(typed_here, quick_cell, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("HEXACELL_LOG_FILE", str(tmp_path / "hexacell.log"))
    typed_here("status", quick_cell.cell)
    assert "exit code 0" in (tmp_path / "hexacell.log").read_text()
