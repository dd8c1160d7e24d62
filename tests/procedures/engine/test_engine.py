"""The engine: steps are journalled before and after; any error or cancellation stops motion in place."""

import asyncio
from typing import Any
from unittest.mock import Mock

import pytest

from hexacell import errors
from hexacell.verdict.decision import Verdict
from procedures.engine.engine import Engine
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.run.trips import RobotNotStopped
from procedures.steps import events
from procedures.steps.events import Step
from procedures.steps.move import Move
from tests.procedures.rig import failure_without_record
from tests.waiting import cancel

P1 = SetKey(phase=Phase.IDENTIFY, point=1)
POSE = (1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
MOVES: list[Step] = [Move(at=P1, orientation=n, pose=POSE) for n in (1, 2, 3)]


class Script:
    """A procedure of given steps; a performer that does nothing but say so, or fail."""

    def __init__(self, devices: Any, steps: list[Step]) -> None:
        self.devices = devices
        self.steps = steps
        self.done: list[str] = []
        self.failure: BaseException | None = None
        self.blocked = asyncio.Event()
        self.blocks = False

    def next_step(self, state: RunState) -> Step | None:
        assert isinstance(state, RunState)
        return self.steps[len(self.done)] if len(self.done) < len(self.steps) else None

    async def prepare(self, state: RunState) -> None:
        del state
        await self.devices.controller.prepare(frozenset())

    async def perform(self, step: Any, state: RunState) -> events.Event:
        if self.failure and len(self.done) == 1:
            raise self.failure
        if self.blocks and len(self.done) == 1:
            self.blocked.set()
            await asyncio.Event().wait()
        self.done.append(step.key)
        return events.Arrived(at=step.at, orientation=step.orientation, pose=step.pose)


@pytest.fixture
def script(bench) -> Script:
    return Script(bench.devices, list(MOVES))


async def test_a_step_is_journalled_before_it_is_performed_and_its_event_afterwards(script, journal, path):
    seen: list[tuple[int, int]] = []
    real = script.perform

    async def perform(step: Any, state: RunState) -> events.Event:
        seen.append((len(script.done), len(read_journal(path))))
        assert read_journal(path)[-1] == events.StepBegun(step=step)
        event: events.Event = await real(step, state)
        return event

    script.perform = perform
    await Engine(script, journal).run()
    assert seen == [(0, 1), (1, 3), (2, 5)]
    kinds = [event.kind for event in read_journal(path)]
    assert kinds == ["begun", "arrived"] * 3 + ["ended"]


async def test_listeners_receive_events_that_are_on_the_disk(script, journal, path) -> None:
    heard: list[events.Event] = []

    def listener(event: events.Event, state: RunState) -> None:
        heard.append(event)
        assert read_journal(path)[-1] == event
        assert state == fold(read_journal(path))

    engine = Engine(script, journal, [listener, listener])
    await engine.run()
    assert heard[::2] == heard[1::2] == list(journal.events)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (errors.DeviceError("does not answer", subject="gauge x"), errors.ExitCode.HARDWARE),
        (errors.LimitError("drifted"), errors.ExitCode.OUT_OF_LIMITS),
        (errors.AnswerNeeded("the run is unattended"), errors.ExitCode.ANSWER_NEEDED),
        (errors.WriteBackUndone("undone"), errors.ExitCode.WRITE_BACK_UNDONE),
        (errors.FileError("changed"), errors.ExitCode.USAGE),
        (
            errors.SeveralErrors("two", [errors.LimitError("drifted"), errors.DeviceError("dead")]),
            errors.ExitCode.HARDWARE,
        ),
        (ZeroDivisionError("division by zero"), errors.ExitCode.FAULT),
    ],
)
async def test_an_error_stops_motion_before_it_is_journalled(script, journal, bench, error, code):
    script.failure = error
    done: list[str] = []

    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.Interrupted):
            done.extend(bench.controller.log)

    with pytest.raises(type(error)) as raised:
        await Engine(script, journal, [listener]).run()
    assert done == bench.controller.log
    assert raised.value is error
    assert bench.controller.log == ["prepare", "stop"]
    assert journal.events[-1] == events.Interrupted(reason=str(error), exit_code=int(code))
    assert journal.events[-2] == events.StepBegun(step=MOVES[1])


async def test_repeated_cancellation_does_not_prevent_the_stop(script, journal, bench) -> None:
    script.blocks = True
    stopped: list[bool] = []

    async def slow_stop() -> None:
        for _ in range(5):
            await asyncio.sleep(0)
            task.cancel()
        stopped.append(True)

    bench.controller.stop = slow_stop
    task = asyncio.create_task(Engine(script, journal).run())
    await script.blocked.wait()
    await cancel(task)
    assert stopped == [True]
    assert journal.events[-1] == events.Interrupted(reason="CancelledError", exit_code=130)


async def test_an_error_while_deciding_stops_motion_too(script, journal, bench) -> None:
    script.next_step = Mock(side_effect=errors.LimitError("the gauges cannot be zeroed"))
    with pytest.raises(errors.LimitError):
        await Engine(script, journal).run()
    assert bench.controller.log == ["prepare", "stop"]
    assert [event.kind for event in journal.events] == ["interrupted"]


async def test_a_controller_that_cannot_be_prepared_ends_the_run_at_once(script, journal, bench) -> None:
    bench.controller.failures["prepare"] = errors.DeviceError("is in emergency stop", subject="controller")
    with pytest.raises(errors.DeviceError, match="emergency"):
        await Engine(script, journal).run()
    assert script.done == []
    assert bench.controller.log == ["prepare", "stop"]
    assert [event.kind for event in journal.events] == ["interrupted"]


@pytest.mark.parametrize(
    "error", [errors.DeviceError("does not answer", subject="gauge x"), errors.Interruption("aborted")]
)
async def test_if_stopping_fails_too_that_is_said_first(script, journal, bench, error) -> None:
    script.failure = error
    bench.controller.failures["stop"] = errors.DeviceError("connection lost", subject="controller")
    with pytest.raises(RobotNotStopped) as failure:
        await Engine(script, journal).run()
    first, then = str(failure.value).splitlines()
    assert first.startswith("PRESS THE EMERGENCY STOP. The robot could not be stopped and may still move: ")
    assert first.endswith("controller: connection lost")
    assert then == str(error)
    assert failure.value.exit_code is errors.ExitCode.HARDWARE
    assert journal.events[-1] == events.Interrupted(reason=str(failure.value), exit_code=3)


@pytest.mark.parametrize("error", [BrokenPipeError(), errors.FileError("the disk is full")])
async def test_an_event_that_is_not_kept_or_not_heard_stops_motion(script, journal, bench, error) -> None:
    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.Arrived):
            raise error

    with pytest.raises(type(error)):
        await Engine(script, journal, [listener]).run()
    assert bench.controller.log == ["prepare", "stop"]


JUDGED = {
    verdict: events.ResultValidated(verdict=verdict, line=f"so it is: {verdict}") for verdict in Verdict
}


@pytest.mark.parametrize(
    ("happened", "code", "line"),
    [
        ([JUDGED[Verdict.PASS]], 0, "so it is: pass"),
        ([JUDGED[Verdict.FAIL]], 1, "so it is: fail"),
        ([JUDGED[Verdict.NOT_EVALUATED]], 1, "so it is: not evaluated"),
        (
            [JUDGED[Verdict.FAIL], events.RolledBack()],
            1,
            "so it is: fail; rolled back, the controller has its old config",
        ),
        ([], 1, "nothing was judged"),
    ],
)
async def test_the_end_of_a_run_has_the_exit_code_and_line_of_its_verdict(
    bench, journal, happened: Any, code: int, line: str
) -> None:
    engine = Engine(Script(bench.devices, []), journal)  # type: ignore[arg-type]
    for event in happened:
        engine.record(event)
    ended = await engine.run()
    assert ended == events.Ended(exit_code=code, line=line)
    assert journal.events[-1] == ended


async def test_a_run_that_is_over_is_not_ended_twice(script, journal) -> None:
    script.steps = []
    first = await Engine(script, journal).run()
    assert await Engine(script, journal).run() == first
    assert [event.kind for event in journal.events] == ["ended"]


def test_open_sets_are_invalidated_or_unverified(script, journal, story) -> None:
    done, begun, zeroed, held = story(point=1), story(point=2), story(point=3), story(Phase.BEFORE, 1)
    interrupted = events.Interrupted(reason="a power cut", exit_code=130)
    in_vain = [*held.whole(2)[:-1], held.refused()]
    for event in [*done.whole(2), *in_vain, *zeroed.whole(2)[:-2], *begun.whole(1)[:2], interrupted]:
        journal.append(event)
    engine = Engine(script, journal)
    engine.reopen_sets()
    voided = [event.at for event in journal.events if isinstance(event, events.SetInvalidated)]
    assert sorted(map(str, voided)) == ["P2", "before-V1"]
    assert {str(key): value.reference_unverified for key, value in engine.state.sets.items()} == {
        "P1": False,
        "P3": True,
    }
    engine.reopen_sets()
    assert engine.state.invalidated == 2


def test_after_a_kill_the_position_is_unknown(script, journal, story) -> None:
    """A killed run writes no last event; the pose it had arrived at is not relied on."""
    journal.append(story().arrived())
    engine = Engine(script, journal)
    assert engine.state.at_pose is not None
    engine.reopen_sets()
    assert engine.state.at_pose is None
    assert isinstance(journal.events[-1], events.Interrupted)


@pytest.mark.parametrize("reload_works", [True, False])
async def test_a_commit_that_cannot_be_journalled_is_reverted_or_reported(
    recording, replayed, monkeypatch, reload_works: bool
) -> None:
    rig = replayed(recording.until(events.Proposed))
    report = await failure_without_record(rig, monkeypatch, events.Committed, reload_works=reload_works)
    assert rig.config == recording.config_before
    assert rig.controller.log.count("reload") == 2, "the geometry that it read is taken from it"
    if not reload_works:
        assert "the controller has the new geometry, which could be neither noted nor taken" in report
    assert (await rig.run()).exit_code == errors.ExitCode.DONE
    assert rig.config == recording.config_after
