"""A recorded run: told up to its cursor, forth, back and by itself."""

import asyncio
from collections.abc import AsyncIterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from hexacell.config.interface import ControllerLimits
from hexacell.errors import FileError, UsageError
from hexacell.kinematics.pose import Pose
from hexacell.run_process.messages import (
    CursorMoved,
    EventRecorded,
    HostMessage,
    QuestionChanged,
    RunDescribed,
    StatusChanged,
)
from hexacell.run_process.recorded import LONGEST_WAIT_S, RecordedRun
from hexacell.runs.run_folder import RunFolder
from procedures.engine.command_loop import Status
from procedures.engine.commands import Undo
from procedures.journal.journal import Entry, encode
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import GaugePlacement
from procedures.steps import events
from procedures.steps.place import Place
from tests.procedures.fakes import ManualClock
from tests.procedures.story import Story

NOON = datetime(2026, 11, 20, 12, 0, tzinfo=UTC)
KEY = SetKey(phase=Phase.IDENTIFY, point=1)
POSE = (100.0, -100.0, 500.0, 0.0, 0.0, 0.0)
STARTED = events.RunStarted(
    software="hexacell 0", cell="a cell", cell_text="", mode="optimise", config="c", config_sha256="",
    controller={}, branch=(1, 1, 1, 1, 1, 1), devices=(), taught={}, joint_ranges=(),
    limits=ControllerLimits(),
)  # fmt: skip
HISTORY: tuple[Any, ...] = (
    STARTED,
    events.StepBegun(step=Place(at=KEY, pose=POSE)),
    *Story(KEY).whole(3),
    events.Paused(),
    events.Resumed(),
    events.Ended(exit_code=0, line="pass"),
)
LAST = len(HISTORY)


def recorded(folder: Path, *at_s: float, restarted: bool = False) -> RunFolder:
    """The run on the disk; each event so many seconds after noon, or one second after the one before."""
    times = [at_s[n] if n < len(at_s) else float(n) for n in range(LAST)]
    lines = [
        encode(Entry(n, NOON + timedelta(seconds=at), 1000.0 + (-at if restarted else at), event))
        for n, (at, event) in enumerate(zip(times, HISTORY, strict=True), start=1)
    ]
    (folder / "journal.jsonl").write_bytes(b"".join(lines))
    return RunFolder(folder)


async def told(messages: AsyncIterator[HostMessage]) -> list[HostMessage]:
    """All that is told until the cursor is reached."""
    found: list[HostMessage] = []
    async for message in messages:
        found.append(message)
        if isinstance(message, CursorMoved):
            break
    return found


def history(messages: list[HostMessage]) -> list[events.Event]:
    return [message.event for message in messages if isinstance(message, EventRecorded)]


def cursor(messages: list[HostMessage]) -> CursorMoved:
    assert isinstance(messages[-1], CursorMoved)
    return messages[-1]


async def test_the_whole_run_is_told_first(tmp_path) -> None:
    run = RecordedRun(recorded(tmp_path))
    messages = await told(run.messages())
    assert messages[0] == RunDescribed(
        cell="a cell", cell_file=tmp_path / "cell.toml", folder=tmp_path, mode="optimise",
        expected_records=4, is_recorded=True,
    )  # fmt: skip
    assert history(messages) == list(HISTORY)
    assert cursor(messages) == CursorMoved(
        sequence=LAST, last=LAST, at=NOON + timedelta(seconds=LAST - 1), speed=0.0
    )
    assert StatusChanged(status=Status.ENDED) in messages


async def test_steps_go_on_event_by_event(tmp_path) -> None:
    run = RecordedRun(recorded(tmp_path))
    run.jump(1)
    messages = run.messages()
    assert history(await told(messages)) == [STARTED]
    run.step()
    assert history(await told(messages)) == [HISTORY[1]]
    run.step(3)
    assert history(await told(messages)) == list(HISTORY[2:5])


async def test_back_in_time_the_run_is_told_anew(tmp_path) -> None:
    run = RecordedRun(recorded(tmp_path))
    messages = run.messages()
    await told(messages)
    run.step(-2)
    again = await told(messages)
    assert isinstance(again[0], RunDescribed)
    assert history(again) == list(HISTORY[:-2])
    run.jump(3)
    assert history(await told(messages)) == list(HISTORY[:3])


async def test_the_cursor_stops_at_both_ends(tmp_path) -> None:
    run = RecordedRun(recorded(tmp_path))
    messages = run.messages()
    for wanted, reached in ((-5, 1), (0, 1), (LAST + 7, LAST)):
        run.jump(wanted)
        assert cursor(await told(messages)).sequence == reached


async def test_questions_to_place_gauges_are_told(tmp_path) -> None:
    run = RecordedRun(recorded(tmp_path))
    run.jump(2)
    messages = run.messages()
    asked = await told(messages)
    [placement] = [
        one.question.subject for one in asked if isinstance(one, QuestionChanged) and one.question
    ]
    assert isinstance(placement, GaugePlacement)
    assert (placement.station, placement.pose) == ("point 1", Pose(100.0, -100.0, 500.0))
    assert StatusChanged(status=Status.AWAITING_OPERATOR) in asked
    run.step()
    answered = await told(messages)
    assert QuestionChanged(question=None) in answered
    assert StatusChanged(status=Status.RUNNING) in answered


@pytest.mark.parametrize("restarted", [False, True])
async def test_it_advances_by_itself_as_fast_as_wanted(tmp_path, restarted: bool) -> None:
    clock = ManualClock()
    run = RecordedRun(recorded(tmp_path, 0.0, 10.0, 30.0, 900.0, restarted=restarted), clock)
    run.jump(1)
    messages = run.messages()
    await told(messages)
    run.set_speed(4.0)
    assert cursor(await told(messages)) == CursorMoved(sequence=1, last=LAST, at=NOON, speed=4.0)
    assert history(await told(messages)) == [HISTORY[1]]
    assert clock.time_s == 2.5
    assert history(await told(messages)) == [HISTORY[2]]
    assert clock.time_s == 7.5
    await told(messages)
    assert clock.time_s == 7.5 + LONGEST_WAIT_S / 4.0, "a long interruption is not waited for"
    run.set_speed(0.0)
    assert cursor(await told(messages)).speed == 0.0


async def test_it_stands_still_at_its_end(tmp_path) -> None:
    clock = ManualClock()
    run = RecordedRun(recorded(tmp_path), clock)
    run.jump(LAST - 1)
    run.set_speed(1.0)
    messages = run.messages()
    await told(messages)
    assert cursor(await told(messages)).sequence == LAST
    waiting = asyncio.ensure_future(anext(messages))
    for _ in range(20):
        await asyncio.sleep(0)
    assert not waiting.done()
    await run.leave(keep_running=False)
    with pytest.raises(StopAsyncIteration):
        await waiting


async def test_nobody_commands_the_past(tmp_path) -> None:
    run = RecordedRun(recorded(tmp_path))
    with pytest.raises(UsageError, match=r"Undo: this run is recorded and takes no commands"):
        await run.give(Undo())
    with pytest.raises(UsageError, match="nobody is in control"):
        await run.take_control()


def test_a_folder_without_a_run_is_refused(tmp_path) -> None:
    with pytest.raises(FileError, match="cannot be read"):
        RecordedRun(RunFolder(tmp_path))
    (tmp_path / "journal.jsonl").touch()
    with pytest.raises(FileError, match="the journal is empty"):
        RecordedRun(RunFolder(tmp_path))
