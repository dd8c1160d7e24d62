"""Interrupted after any event, and again while it resumes: every record once, and a valid result."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import pytest

from hexacell.errors import ExitCode, Interruption
from procedures.engine.commands import Abort
from procedures.journal.journal import read_journal
from procedures.run.state import RunState, fold
from procedures.steps import events

TELLING = 125
"""Events of a whole run of the small cell, and a few more."""


class PowerCut(BaseException):
    """Nothing after it is written down: neither a word of farewell nor a stop."""


def at(number: int, action: Any) -> Any:
    """A listener that does something at the ``number``-th event that it hears."""
    heard = [0]

    def listener(event: events.Event, _: RunState) -> None:
        heard[0] += 1
        if heard[0] == number:
            action()

    return listener


async def ended_by_command(rig: Any, number: int) -> bool:
    """Run until somebody aborts at an event; whether it came to that."""
    try:
        await rig.run(at(number, lambda: rig.engine.command(Abort())))
    except Interruption:
        return True
    return False


async def ended_by_power_cut(rig: Any, number: int) -> bool:
    """Run until the process dies at an event: its journal ends there."""

    path = rig.folder.journal
    kept: list[bytes] = []

    def die() -> None:
        kept.append(path.read_bytes())
        raise PowerCut

    try:
        await rig.run(at(number, die))
    except PowerCut:
        path.write_bytes(kept[0])  # as if the engine had not got to say that it was interrupted
        return True
    return False


def require_every_record_once(history: Sequence[events.Event]) -> None:
    state = fold(history)
    assert [len(measured.samples) for measured in state.sets.values()] == [9, 9, 3, 3, 5, 5]
    for measured in state.sets.values():
        assert measured.closed
        counted = Counter(sample.orientation for sample in measured.samples)
        assert set(counted.values()) == {1}
    in_journal = [event for event in history if isinstance(event, events.RecordTaken)]
    assert len(in_journal) == len(set(map(id, in_journal)))
    for measured in state.sets.values():
        assert all(sample in in_journal for sample in measured.samples)


WAYS = {"aborted": ended_by_command, "power cut": ended_by_power_cut}


async def interrupted_twice(rig: Any, how: str, first: int, second: int) -> None:
    for number in (first, second):
        if await WAYS[how](rig, number):
            before = read_journal(rig.folder.journal)
            assert fold(before).ended is None
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    history = read_journal(rig.folder.journal)
    require_every_record_once(history)
    voided = [event.reason for event in history if isinstance(event, events.SetInvalidated)]
    assert set(voided) <= {"the run was interrupted in this set"}, "no set with a record was measured anew"


HERE_AND_THERE = [("power cut", 7, 5), ("aborted", 16, 4), ("power cut", 3, 9)]
"""From the drawing, the last one's records lead to another robot, whose gauges would read in inches."""

LATER = [pytest.param("power cut", 1, 27, 3, marks=pytest.mark.slow), ("aborted", 2, 14, 6)]
"""The first number is of sets that are measured already."""


@pytest.mark.sample("power cut-3-9")
@pytest.mark.parametrize(("how", "first", "second"), HERE_AND_THERE)
async def test_a_run_interrupted_twice_from_its_beginning_finishes_with_every_record_once(
    make_rig, how: str, first: int, second: int
) -> None:
    await interrupted_twice(make_rig(), how, first, second)


@pytest.mark.parametrize(("how", "sets", "first", "second"), LATER)
async def test_a_run_interrupted_twice_after_whole_sets_finishes_with_every_record_once(
    recording, replayed, how: str, sets: int, first: int, second: int
) -> None:
    rig = replayed(recording.until(events.SetClosed, count=sets))
    await interrupted_twice(rig, how, first, second)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1, TELLING))
async def test_a_run_interrupted_after_any_event_and_again_finishes_with_every_record_once(
    make_rig, first: int
) -> None:
    how = list(WAYS)[first % 2]
    await interrupted_twice(make_rig(), how, first, 1 + (7 * first) % 13)
