"""``run --events FILE``: the journal's lines for another program, which the run never waits for."""

import os
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
