"""Commands to a running engine: which interrupt a step, which wait for its end, and their events."""

import asyncio
import threading
from collections.abc import AsyncIterator
from typing import Any

import pytest

from hexacell.errors import ExitCode, Interruption
from procedures.engine.command_loop import Status
from procedures.engine.commands import Abort, Answer, MeasureAgain, Pause, Resume, Stop, Undo
from procedures.engine.engine import Engine
from procedures.journal.journal import Journal, read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.events import Step
from procedures.steps.move import Move
from procedures.steps.sample import Sample
from tests.procedures.fakes import SilentOperator
from tests.procedures.runs.listening import happened, on, run_until
from tests.procedures.story import READING
from tests.waiting import until

P1 = SetKey(phase=Phase.IDENTIFY, point=1)


def pose(orientation: int) -> Any:
    return (1.0, 2.0, 3.0, float(orientation), 0.0, 0.0)


class Script:
    """A set of three records; any step may be held up until it is let go, or cancelled."""

    def __init__(self, devices: Any) -> None:
        self.devices = devices
        self.hold: str | None = None
        self.held = asyncio.Event()
        self.let_go = asyncio.Event()
        self.begun: list[str] = []

    def next_step(self, state: RunState) -> Step | None:
        orientation = state.set(P1).next_orientation
        if orientation > 3:
            return None
        kind = Sample if state.at_pose == (P1, orientation) else Move
        return kind(at=P1, orientation=orientation, pose=pose(orientation))

    async def prepare(self, state: RunState) -> None:
        del state
        await self.devices.controller.prepare(frozenset())

    async def perform(self, step: Any, state: RunState) -> events.Event:
        self.begun.append(step.key)
        if step.key == self.hold:
            self.held.set()
            await self.let_go.wait()
        if isinstance(step, Move):
            return events.Arrived(at=P1, orientation=step.orientation, pose=step.pose)
        return events.RecordTaken(
            at=P1, orientation=step.orientation, pose=step.pose, reading=READING, deviation_mm=(0.0,) * 3
        )


class Stage:
    """An engine that runs a script up to where it is held."""

    def __init__(self, devices: Any, journal: Journal) -> None:
        self.script = Script(devices)
        self.journal = journal
        self.engine = Engine(self.script, journal, [self._hear])  # type: ignore[arg-type]
        self.statuses: list[Status] = []
        self.engine.commands.watchers.append(self.statuses.append)
        self._waiting: list[tuple[type[Any], asyncio.Event]] = []
        self.running: asyncio.Task[events.Ended] | None = None

    def _hear(self, event: events.Event, _: RunState) -> None:
        for kind, has_come in self._waiting:
            if isinstance(event, kind):
                has_come.set()

    async def until(self, kind: type[Any]) -> None:
        has_come = asyncio.Event()
        self._waiting.append((kind, has_come))
        await has_come.wait()

    async def held_at(self, key: str | None) -> None:
        self.script.hold = key
        self.running = asyncio.create_task(self.engine.run())
        if key:
            await self.script.held.wait()

    async def paused_at(self, key: str, *, at_once: bool) -> None:
        await self.held_at(key)
        self.engine.queue.put(Pause(at_once))
        await asyncio.sleep(0)
        if not at_once:
            self.script.let_go.set()
        await self.until(events.Paused)

    async def over(self) -> events.Ended:
        assert self.running
        self.script.let_go.set()
        return await self.running

    @property
    def kinds(self) -> list[str]:
        return [event.kind for event in self.journal.events if not isinstance(event, events.StepBegun)]


@pytest.fixture
async def stage(bench, journal) -> AsyncIterator[Stage]:
    made = Stage(bench.devices, journal)
    yield made
    if made.running and not made.running.done():
        made.running.cancel()
        await asyncio.wait([made.running])


async def test_a_pause_after_the_record_waits_for_the_record(stage: Stage, bench) -> None:
    await stage.paused_at("P1/o02/move", at_once=False)
    assert stage.kinds[-3:] == ["arrived", "sampled", "paused"]
    assert stage.engine.status is Status.PAUSED
    assert "stop" not in bench.controller.log
    stage.engine.queue.put(Resume())
    await stage.over()
    assert stage.script.begun == [f"P1/o0{n}/{what}" for n in (1, 2, 3) for what in ("move", "sample")]
    assert stage.statuses == [
        *(Status.RUNNING, Status.PAUSING, Status.PAUSED, Status.RUNNING, Status.ENDED)
    ]


@pytest.mark.parametrize("key", ["P1/o02/move", "P1/o02/sample"])
async def test_a_pause_at_once_stops_motion_and_the_step_is_decided_again(stage, bench, key: str) -> None:
    await stage.paused_at(key, at_once=True)
    assert bench.controller.log == ["prepare", "stop"]
    assert stage.engine.state.position_unknown
    assert stage.engine.state.set(P1).reference_unverified
    begun = len(stage.script.begun)
    for _ in range(5):
        await asyncio.sleep(0)
    assert len(stage.script.begun) == begun, "nothing moves during a pause"
    stage.engine.queue.put(Resume())
    await stage.over()
    assert stage.script.begun[begun] == "P1/o02/move"
    assert bench.controller.log == ["prepare", "stop", "prepare"]


async def test_a_resume_before_the_pause_begins_cancels_it(stage: Stage) -> None:
    await stage.held_at("P1/o02/move")
    for command in (Pause(), Resume()):
        stage.engine.queue.put(command)
    await stage.over()
    assert "paused" not in stage.kinds


async def test_undo_discards_the_last_record_at_the_time_of_the_command(stage: Stage) -> None:
    """Not the record that is being taken at that time."""
    await stage.held_at("P1/o03/sample")
    stage.engine.queue.put(Undo())
    await stage.over()
    assert events.RecordDiscarded(at=P1, orientation=2) in stage.journal.events
    taken = [sample.orientation for sample in fold(stage.journal.events).set(P1).samples]
    assert taken == [1, 3, 2]
    sampled = [event.orientation for event in stage.journal.events if isinstance(event, events.RecordTaken)]
    assert sampled == [1, 2, 3, 2], "what was discarded stays in the journal"


@pytest.mark.parametrize(
    ("command", "event"),
    [
        (MeasureAgain(P1, 2), events.RecordDiscarded(at=P1, orientation=2)),
        (MeasureAgain(P1, 1), events.SetInvalidated(at=P1, reason="a person asked for it")),
        (MeasureAgain(P1), events.SetInvalidated(at=P1, reason="a person asked for it")),
    ],
)
async def test_measure_again_discards_the_record_or_the_set(stage, command, event):
    await stage.held_at("P1/o03/sample")
    stage.engine.queue.put(command)
    await stage.over()
    assert event in stage.journal.events
    orientations = [sample.orientation for sample in fold(stage.journal.events).set(P1).samples]
    assert sorted(orientations) == [1, 2, 3]


async def test_the_last_record_is_taken_again_though_the_robot_has_left_its_point(recording, replayed):
    rig = replayed(recording.until(events.SetClosed, count=1), identification__orientations=4)
    last = max(one.orientation for one in happened(rig, events.RecordTaken) if one.at == P1)
    left = on(events.StepBegun, lambda: rig.engine.queue.put(Undo()))
    await run_until(rig, events.SetClosed, left, count=1)
    assert events.RecordDiscarded(at=P1, orientation=last) in happened(rig, events.RecordDiscarded)
    state = fold(read_journal(rig.folder.journal))
    assert state.set(P1).closed, "it is measured to its end again"
    assert sorted(one.orientation for one in state.set(P1).samples) == list(range(1, last + 1))


async def test_records_may_be_undone_during_a_pause(stage: Stage) -> None:
    await stage.paused_at("P1/o02/sample", at_once=False)
    stage.engine.queue.put(Undo())
    await stage.until(events.RecordDiscarded)
    assert stage.engine.status is Status.PAUSED
    stage.engine.queue.put(Resume())
    await stage.over()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (Resume(), "the run is not paused"),
        (Answer("yes"), "no question is open that this would answer"),
        (Undo(), "there is no record to undo yet"),
        (MeasureAgain(P1, 7), "P1 has no such record"),
    ],
)
async def test_a_command_that_cannot_be_obeyed_is_rejected(stage, command: Any, words: str) -> None:
    await stage.held_at("P1/o01/sample")
    stage.engine.queue.put(command)
    ended = await stage.over()
    declined = events.CommandRejected(command=type(command).__name__, reason=words)
    assert [event for event in stage.journal.events if isinstance(event, events.CommandRejected)] == [
        declined
    ]
    assert ended.exit_code == ExitCode.OUT_OF_LIMITS, "nothing was judged in this script"


async def test_a_stop_ends_the_run_after_the_current_step(stage: Stage, bench) -> None:
    await stage.held_at("P1/o02/sample")
    stage.engine.queue.put(Stop("a stop was asked for"))
    await until(lambda: stage.engine.status is Status.STOPPING)
    with pytest.raises(Interruption) as ended:
        await stage.over()
    assert ended.value.exit_code is ExitCode.INTERRUPTED
    assert stage.kinds[-2:] == ["sampled", "interrupted"]
    assert stage.journal.events[-1] == events.Interrupted(reason="a stop was asked for", exit_code=130)
    assert bench.controller.log == ["prepare", "stop"]


@pytest.mark.parametrize("commands", [[Abort()], [Stop("aborted"), Abort()]])
async def test_an_abort_ends_the_run_within_a_step_and_stops_motion(stage: Stage, bench, commands) -> None:
    await stage.held_at("P1/o02/move")
    for command in commands:
        stage.engine.queue.put(command)
    with pytest.raises(Interruption):
        await stage.running  # type: ignore[misc]  # the step is never let go
    assert stage.journal.events[-1] == events.Interrupted(reason="aborted", exit_code=130)
    assert stage.journal.events[-2].kind == "begun"
    assert bench.controller.log == ["prepare", "stop"]


@pytest.mark.parametrize("command", [Stop(), Abort()])
async def test_a_stop_or_abort_ends_a_paused_run_at_once(stage: Stage, command: Any) -> None:
    await stage.paused_at("P1/o02/move", at_once=True)
    stage.engine.queue.put(command)
    with pytest.raises(Interruption):
        await stage.running  # type: ignore[misc]
    assert stage.kinds[-2:] == ["paused", "interrupted"]


async def test_commands_given_before_the_start_are_obeyed(stage: Stage) -> None:
    stage.engine.queue.put(Stop("before"))
    with pytest.raises(Interruption, match="before"):
        await stage.engine.run()
    assert stage.script.begun == []


async def test_a_command_from_another_thread_is_obeyed_at_once(stage: Stage) -> None:
    await stage.held_at("P1/o02/move")
    thread = threading.Thread(target=stage.engine.queue.put, args=(Abort("from a thread"),))
    thread.start()
    with pytest.raises(Interruption, match="from a thread"):
        await stage.running  # type: ignore[misc]
    thread.join()


@pytest.fixture
def asking(recording, replayed) -> Any:
    """A run that comes to ask for an approval, which nobody gives at the terminal."""
    rig = replayed(recording.until(events.Proposed)[:-1], acceptance__approval="ask")
    object.__setattr__(rig.performer, "operator", SilentOperator())
    return rig


async def run_giving(rig: Any, command: Any) -> events.Ended:
    """Run, and give a command as soon as a question is open."""

    def give(status: Status) -> None:
        if status is Status.AWAITING_OPERATOR:
            rig.engine.queue.put(command)

    ended: events.Ended = await rig.run(
        on(events.StepBegun, lambda: rig.engine.commands.watchers.append(give))
    )
    return ended


async def test_a_question_may_be_answered_by_command(asking) -> None:
    assert (await run_giving(asking, Answer("a name"))).exit_code == ExitCode.DONE
    assert events.Committed(approved_by="a name") in read_journal(asking.folder.journal)


@pytest.mark.parametrize("command", [Stop(), Abort()])
async def test_a_run_that_waits_for_an_answer_can_be_ended(recording, asking, command) -> None:
    with pytest.raises(Interruption):
        await run_giving(asking, command)
    assert asking.config == recording.config_before
