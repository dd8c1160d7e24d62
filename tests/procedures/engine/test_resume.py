"""A run interrupted anywhere resumes: no record is lost, and open sets are confirmed or invalidated."""

import asyncio
import threading
from collections.abc import Sequence
from typing import Any

import pytest

from hexacell.config.change import ConfigChange
from hexacell.config.write_back import commit
from hexacell.errors import ExitCode
from procedures.journal.journal import read_journal
from procedures.resources import controller_config as config_changes
from procedures.run.state import fold
from procedures.steps import events
from tests.procedures.runs.listening import ended_by_command, ended_by_power_cut

INTERRUPTED = events.Interrupted(reason="a power cut", exit_code=130)


PLACES: dict[str, tuple[type[Any], int]] = {
    "in the first set": (events.RecordTaken, 5),
    "at the second point": (events.Arrived, 11),
    "with everything measured": (events.SetClosed, 2),
    "with the geometry identified": (events.Identified, 1),
    "at a held-out point": (events.RecordTaken, 20),
    "with the geometry proposed": (events.Proposed, 1),
    "with the geometry written": (events.Committed, 1),
    "at a held-out point afterwards": (events.RecordTaken, 26),
    "with everything verified": (events.SetClosed, 6),
    "with the verdict given": (events.ResultValidated, 1),
}
KILLED = {"in the first set", "at a held-out point afterwards"}
"""Here the process ended without a word; in the other places it could still write one."""


@pytest.mark.sample("with the geometry *", "at a held-out point afterwards", "with the verdict given")
@pytest.mark.parametrize("place", PLACES)
async def test_a_run_resumes_after_an_interruption_at_any_stage(recording, replayed, place: str) -> None:
    kind, count = PLACES[place]
    done = recording.until(kind, count=count)
    rig = replayed(done if place in KILLED else [*done, INTERRUPTED])
    first = read_journal(rig.folder.journal)
    ended = await rig.run()

    history = read_journal(rig.folder.journal)
    assert ended.exit_code == ExitCode.DONE
    assert history[: len(first)] == first, "nothing that was recorded is lost"
    before, after = fold(first), fold(history)
    seen = {
        event.at
        for event in history
        if isinstance(event, events.SetInvalidated | events.ReferenceConfirmed)
    }
    assert seen == {key for key, measured in before.sets.items() if not measured.closed}
    kept = {key: measured for key, measured in before.sets.items() if measured.closed}
    assert {key: after.sets[key] for key in kept} == kept
    require_whole_sets(history)
    readings = [found for one in history if (found := getattr(one, "reading", None)) is not None]
    assert [one.at_s for one in readings] == sorted(one.at_s for one in readings), "their time goes on"


def require_whole_sets(history: Sequence[events.Event]) -> None:
    """Every set is closed, its records are there once, and none was taken while its zero was in doubt."""
    state = fold(history)
    assert [len(measured.samples) for measured in state.sets.values()] == [9, 9, 3, 3, 5, 5]
    for measured in state.sets.values():
        assert measured.closed
        taken = [sample.orientation for sample in measured.samples]
        assert sorted(taken) == list(range(1, len(taken) + 1))
    doubted: set[Any] = set()
    arrived: tuple[int, ...] = ()
    for event in history:
        if isinstance(event, events.RecordTaken):
            assert len(arrived) == 6
            assert event.record.directions == arrived
        if isinstance(event, events.Arrived | events.Located | events.Interrupted):
            arrived = getattr(event, "directions", ())
        match event:
            case events.Interrupted():
                doubted = set(state.sets)
            case events.ReferenceConfirmed() | events.SetInvalidated():
                doubted -= {event.at}
            case events.RecordTaken(orientation=1):
                doubted -= {event.at}
            case events.RecordTaken() | events.SetClosed():
                assert event.at not in doubted


async def test_a_write_back_in_progress_is_completed_despite_cancellation(recording, replayed, monkeypatch):
    rig = replayed(recording.until(events.Proposed))
    running = asyncio.create_task(rig.run())
    cancelled = threading.Event()

    def cancel() -> None:
        running.cancel()
        running.get_loop().call_soon(cancelled.set)  # when the run has met its cancellation

    def slow_commit(*order: Any) -> Any:
        running.get_loop().call_soon_threadsafe(cancel)
        cancelled.wait()
        return commit(*order)

    monkeypatch.setattr(config_changes, "commit", slow_commit)
    with pytest.raises(asyncio.CancelledError):
        await running
    assert rig.config == recording.config_after
    monkeypatch.undo()
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert rig.config == recording.config_after


async def test_a_config_written_but_not_journalled_is_not_written_twice(recording, replayed) -> None:
    rig = replayed(recording.until(events.Proposed))
    commit(ConfigChange.load(rig.folder.proposal), rig.folder.path)
    assert rig.config == recording.config_after
    assert (await rig.run()).exit_code == ExitCode.DONE
    assert rig.config == recording.config_after
    backup = rig.folder.path / "config-before"
    assert backup.read_bytes() == recording.config_before


TELLING = 125
"""Events of a whole run of the small cell, and a few more."""


WAYS = (ended_by_command, ended_by_power_cut)


async def interrupted_twice(rig: Any, end: Any, first: int, second: int) -> None:
    for number in (first, second):
        if await end(rig, number):
            before = read_journal(rig.folder.journal)
            assert fold(before).ended is None
    ended = await rig.run()
    assert ended.exit_code == ExitCode.DONE
    history = read_journal(rig.folder.journal)
    require_whole_sets(history)
    voided = [event.reason for event in history if isinstance(event, events.SetInvalidated)]
    assert set(voided) <= {"the run was interrupted in this set"}, "no set with a record was measured anew"


@pytest.mark.sample("3")
@pytest.mark.parametrize("first", range(1, TELLING))
async def test_a_run_interrupted_after_any_event_and_again_finishes_with_every_record_once(make_rig, first):
    await interrupted_twice(make_rig(), WAYS[first % 2], first, 1 + (7 * first) % 13)
