"""What the journal costs: a record on the disk, and opening a long one."""

import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

from procedures.journal import journal as line_format
from procedures.journal.journal import Entry, Journal, encode
from procedures.run.keys import Phase, SetKey
from procedures.run.readings import Reading
from procedures.run.state import fold
from procedures.steps import events
from tests.benchmarks.figures import at_most

RECORDS = 10_000
APPENDED, RECORDS_A_SET = 400, 20
WINDOW = 7
"""Readings in a settled window, as with the times of the demo's cell."""


def sampled(number: int) -> events.RecordTaken:
    """A record such as a run has."""
    value = number / 7
    reading = Reading(
        gauges_mm=(0.123, 1.2345, value),
        spread_mm=(0.001, 0.002, 0.003),
        joints=(value, 2 * value, 3 * value, 4 * value, 5 * value, 6 * value),
        answers=(("+1.234\r", "01A+00001.234\r", "1.234\r"),) * WINDOW,
        counts=((123456, 123457, 123458, -123459, 123460, 123461),) * WINDOW,
        skews_s=(0.002,) * WINDOW,
    )
    place, orientation = divmod(number, RECORDS_A_SET)
    return events.RecordTaken(
        at=SetKey(phase=Phase.IDENTIFY, point=place + 1),
        orientation=orientation + 1,
        pose=(100.0, -100.0, 500.0, value, -value, 0.125),
        reading=reading,
        deviation_mm=(0.1, -0.2, value),
    )


def timed(work: Callable[[], object]) -> float:
    """Seconds on the wall: waiting for the disk is what counts."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def test_a_record_against_the_bare_disk(tmp_path: Path, figure) -> None:
    """Taken in turns, so that whatever else keeps the disk busy counts for both."""
    line = encode(Entry(1, *line_format.now(), sampled(1)))
    descriptor = os.open(tmp_path / "bare", os.O_CREAT | os.O_WRONLY | os.O_APPEND)

    def bare() -> None:
        os.write(descriptor, line)
        os.fsync(descriptor)

    ours, disk = [], []
    with Journal(tmp_path / "journal.jsonl") as journal:
        for number in range(APPENDED):
            ours.append(timed(partial(journal.append, sampled(number))))
            disk.append(timed(bare))
    os.close(descriptor)
    cost, least = 1e3 * median(ours), 1e3 * median(disk)
    # Where the disk itself is slower than that, the journal must not add as much again.
    figure("a record on the disk, median", cost, "ms", at_most(max(2.0, 2.0 * least)))
    figure("  the same bytes written and forced out, nothing else", least, "ms")


def test_a_long_journal_opens_quickly(tmp_path: Path, figure) -> None:
    path = tmp_path / "journal.jsonl"
    when = line_format.now()
    path.write_bytes(b"".join(encode(Entry(n + 1, *when, sampled(n))) for n in range(RECORDS)))
    begun = time.process_time()
    with Journal(path) as journal:
        state = fold(journal.events)
    seconds = time.process_time() - begun
    assert len(state.samples(Phase.IDENTIFY)) == RECORDS
    figure(f"{RECORDS:,} records: opened and folded in", seconds, "s", at_most(1.0))
