"""Recovery from failures: escalations that end, counted attempts, repeated sets, latched faults."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from drivers.controllers.errors import ConnectionLost, MotionInterrupted, MoveRefused, ResponseTimeout
from drivers.errors import (
    BusError,
    GaugeAtEnd,
    GaugeSilent,
    GaugeUnsteady,
    InvalidSampleError,
    PortLost,
    RestartedNodeError,
    SilentNodeError,
    WrongSetting,
    ZeroVoid,
)
from drivers.interfaces import DeviceIdentity
from hexacell.cell.recovery import Action, FailureKind, RecoverySettings
from hexacell.errors import (
    AnswerNeeded,
    DeviceError,
    ExitCode,
    FileError,
    HexacellError,
    Interruption,
    LimitError,
    SeveralErrors,
    UsageError,
    WriteBackUndone,
)
from procedures.calibration.path_planning import NoSafePath
from procedures.calibration.set_steps import TravelError
from procedures.devices.settling import NeverSettled
from procedures.engine.command_loop import Status
from procedures.engine.recovery import GIVE_UP, RecoveryPolicy, failed, kind_of
from procedures.journal.journal import read_journal
from procedures.run import events
from procedures.run.commands import Abort, Answer, Pause, Resume, Stop
from procedures.run.state import RunState, fold
from procedures.run.steps import Phase, Sample, SetKey
from procedures.run.trips import DriftTripped, Guard, Trip
from tests.waiting import until

UNATTENDED = RecoveryPolicy.of(RecoverySettings(), attended=False)
ATTENDED = RecoveryPolicy.of(RecoverySettings(), attended=True)
P1, P2 = (SetKey(phase=Phase.IDENTIFY, point=point) for point in (1, 2))
STEP = Sample(at=P1, orientation=2, pose=(0.0,) * 6)


class TrippedGuard(DeviceError):
    """As another part of the program may define it."""


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (GaugeSilent("does not answer"), FailureKind.GAUGE_SILENT),
        (GaugeUnsteady("swings"), FailureKind.UNSETTLED),
        (NeverSettled("moves"), FailureKind.UNSETTLED),
        (GaugeAtEnd("at its end"), FailureKind.GAUGE_AT_END),
        (TravelError("at its end"), FailureKind.GAUGE_AT_END),
        (WrongSetting("inch"), FailureKind.GAUGE_SETTING),
        (ZeroVoid("was off"), FailureKind.ZERO_VOID),
        (SilentNodeError("silent"), FailureKind.ENCODER_SILENT),
        (InvalidSampleError("no magnet"), FailureKind.ENCODER_ALARM),
        (RestartedNodeError("booted"), FailureKind.ENCODER_RESTARTED),
        (BusError("died"), FailureKind.LINK_LOST),
        (PortLost("port /dev/x was lost"), FailureKind.LINK_LOST),
        (ConnectionLost("gone"), FailureKind.LINK_LOST),
        (ResponseTimeout("late"), FailureKind.LINK_LOST),
        (MoveRefused("to move", "limits", subject="controller"), FailureKind.CONTROLLER),
        (MotionInterrupted("stopped elsewhere"), FailureKind.CONTROLLER),
        (DriftTripped(Trip(Guard.DRIFT, "P1", "drifted", "Resume")), FailureKind.DRIFT),
        (NoSafePath("no way"), FailureKind.NO_WAY),
        (FileError("disk full"), FailureKind.FILE),
        (TrippedGuard("following error"), FailureKind.OTHER),
        (LimitError("declined"), FailureKind.FINAL),
        (AnswerNeeded("nobody"), FailureKind.FINAL),
        (WriteBackUndone("undone"), FailureKind.FINAL),
        (UsageError("unknown"), FailureKind.FINAL),
    ],
)
def test_the_class_of_an_error_decides_its_kind(error: HexacellError, kind: FailureKind) -> None:
    assert kind_of(error) is kind


@pytest.mark.parametrize("policy", [ATTENDED, UNATTENDED, GIVE_UP])
@pytest.mark.parametrize("kind", FailureKind)
def test_every_escalation_ends(policy: RecoveryPolicy, kind: FailureKind) -> None:
    assert policy.action(kind, 1000) in {Action.ASK, Action.ABORT}
    assert policy.action(FailureKind.FINAL, 1) is Action.ABORT


def test_only_an_attended_run_asks_and_it_always_does() -> None:
    kinds = [kind for kind in FailureKind if kind is not FailureKind.FINAL]
    assert all(ATTENDED.action(kind, 1) is Action.ASK for kind in kinds)
    assert all(UNATTENDED.action(kind, n) is not Action.ASK for kind in kinds for n in range(1, 9))


def test_attempts_are_counted_by_kind_and_set_since_the_last_interruption() -> None:
    silent, drift = GaugeSilent("silent"), DriftTripped(Trip(Guard.DRIFT, "P1", "drifted", "Resume"))
    told: list[events.Event] = []
    for error in (silent, silent, drift, silent, silent):
        told.append(failed(UNATTENDED, error, STEP, fold(told)))
    actions = [(event.attempt, event.action.value) for event in told if isinstance(event, events.Failed)]
    assert actions == [(1, "retry"), (2, "redo-set"), (1, "redo-set"), (3, "redo-set"), (4, "abort")]
    told.append(events.Interrupted(reason="x", exit_code=3))
    assert failed(UNATTENDED, silent, STEP, fold(told)).attempt == 1


def test_the_most_serious_of_several_failures_determines_the_action() -> None:
    several = SeveralErrors("two", [GaugeSilent("silent"), WrongSetting("inch")])
    failure = failed(UNATTENDED, several, STEP, RunState())
    assert (failure.failure, failure.action) == (FailureKind.GAUGE_SETTING, Action.ABORT)


def failing(key: str, action: Callable[[], Any], times: int = 1) -> Any:
    """A listener that does something whenever a step is begun, so many times."""
    left = [times]

    def listener(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.StepBegun) and event.step.key == key and left[0]:
            left[0] -= 1
            action()

    return listener


async def until_closed(rig: Any, *listeners: Any, policy: RecoveryPolicy) -> bool:
    """Run until the second point is measured; whether it came to that."""

    def stop(event: events.Event, _: RunState) -> None:
        if isinstance(event, events.SetClosed):
            rig.engine.command(Stop())

    with pytest.raises(Interruption):
        await rig.run(*listeners, stop, policy=policy)
    return fold(read_journal(rig.folder.journal)).set(P2).closed


def happened(rig: Any, kind: type[Any]) -> list[Any]:
    return [event for event in read_journal(rig.folder.journal) if isinstance(event, kind)]


SILENT = GaugeSilent("does not answer", subject="gauge y")
KEY = "P2/o03/sample"


@pytest.fixture
def at_second_point(recording, replayed) -> Any:
    """One point measured; the second one gets four records only, which is enough to go wrong in."""
    return replayed(recording.until(events.SetClosed, count=1), identification__orientations=4)


@pytest.mark.parametrize(("times", "reopened", "voided"), [(1, 0, 0), (2, 1, 1), (3, 2, 2)])
async def test_an_unattended_run_retries_a_silent_gauge_and_then_redoes_its_set(
    at_second_point, times: int, reopened: int, voided: int
) -> None:
    rig = at_second_point
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT), times)
    assert await until_closed(rig, silent, policy=UNATTENDED)
    assert [event.attempt for event in happened(rig, events.Failed)] == list(range(1, times + 1))
    assert rig.gauges[1].closed == reopened
    assert [str(event.at) for event in happened(rig, events.SetInvalidated)] == ["P2"] * voided
    assert rig.gauges[0].closed == 0, "the others are left alone"


async def test_an_unattended_run_ends_after_a_bounded_number_of_attempts(at_second_point) -> None:
    rig = at_second_point
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT), 100)
    with pytest.raises(GaugeSilent):
        await rig.run(silent, policy=UNATTENDED)
    assert [event.action.value for event in happened(rig, events.Failed)] == [
        "retry",
        "redo-set",
        "redo-set",
    ]
    assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.HARDWARE
    assert rig.engine.status is Status.FAULTED, "a fault latches"
    assert rig.controller.log[-1] == "stop"


async def test_after_a_lost_encoder_bus_the_reference_is_confirmed_again(at_second_point) -> None:
    rig = at_second_point
    encoders = rig.bench.encoders

    def unplug() -> None:
        encoders.failure = BusError("has died", subject="encoder bus")

    async def back() -> Any:
        encoders.failure = None
        return encoders._answering("encoder 1")

    encoders.open = back
    assert await until_closed(rig, failing(KEY, unplug), policy=UNATTENDED)
    (failure,) = happened(rig, events.Failed)
    assert (failure.failure, failure.action) == (FailureKind.LINK_LOST, Action.MEASURE_AGAIN)
    assert [str(event.at) for event in happened(rig, events.ReferenceConfirmed)] == ["P2"]
    assert not happened(rig, events.SetInvalidated)


def jumped_while_away(rig: Any, jump_mm: float) -> Any:
    """The bus of the encoders is lost at a record; that of leg 3 comes back with another zero."""
    encoders, shown = rig.bench.encoders, rig.bench.encoders.shown

    def unplug() -> None:
        encoders.failure = BusError("has died", subject="encoder bus")

    async def back() -> Any:
        encoders.failure = None
        encoders.shown = lambda: [q + jump_mm * (leg == 3) for leg, q in enumerate(shown(), 1)]
        return encoders._answering("encoder 1")

    encoders.open = back
    return failing(KEY, unplug)


async def test_an_encoder_that_jumped_while_it_was_away_is_named(at_second_point) -> None:
    rig = at_second_point
    with pytest.raises(HexacellError, match=r"encoder 3: shows slider 3 at .* See whether it slipped"):
        await rig.run(jumped_while_away(rig, 3.0), policy=UNATTENDED)
    assert "P2" not in [str(event.at) for event in happened(rig, events.ReferenceConfirmed)]


async def test_a_small_jump_while_it_was_away_costs_the_set(at_second_point) -> None:
    rig = at_second_point
    assert await until_closed(rig, jumped_while_away(rig, 0.2), policy=UNATTENDED)
    (invalidated,) = happened(rig, events.SetInvalidated)
    assert str(invalidated.at) == "P2"
    assert invalidated.reason.startswith("back at its reference q3 shows +0.2")


async def test_a_device_that_cannot_be_reopened_ends_the_run(at_second_point) -> None:
    rig = at_second_point
    encoders = rig.bench.encoders
    encoders_lost = BusError("has died", subject="encoder bus")

    def unplug() -> None:
        encoders.failure = encoders.dead = encoders_lost

    with pytest.raises(BusError):
        await rig.run(failing(KEY, unplug), policy=UNATTENDED)
    assert len(happened(rig, events.Failed)) == 3


async def test_a_void_zero_invalidates_the_set(at_second_point) -> None:
    rig = at_second_point
    gauge = rig.gauges[0]
    void = ZeroVoid("was off in between", subject="gauge x")

    def switch_off() -> None:
        gauge.void = void

    async def back() -> Any:
        gauge.void = None
        return gauge._answering("x")[0]

    gauge.open = back
    assert await until_closed(rig, failing("P2/close", switch_off), policy=UNATTENDED)
    assert [event.reason for event in happened(rig, events.SetInvalidated)] == [
        "a gauge was opened again, its zero is void"
    ]


async def test_a_robot_that_cannot_be_stopped_ends_the_run_without_recovery(at_second_point) -> None:
    rig = at_second_point

    def break_down() -> None:
        rig.gauges[1].failures.append(SILENT)
        rig.controller.failures["stop"] = DeviceError("could not be stopped", subject="controller")

    with pytest.raises(GaugeSilent):
        await rig.run(failing(KEY, break_down), policy=UNATTENDED)
    assert not happened(rig, events.Failed)


async def test_drift_redoes_the_set(at_second_point) -> None:
    rig = at_second_point
    real, slipped = rig.gauges[1].shown, [0.0]
    rig.gauges[1].shown = lambda: real() + slipped[0]

    def slip() -> None:
        slipped[0] = 0.2

    assert await until_closed(rig, failing("P2/close", slip), policy=UNATTENDED)
    (failure,) = happened(rig, events.Failed)
    assert (failure.failure, failure.action) == (FailureKind.DRIFT, Action.REDO_SET)
    assert [str(event.at) for event in happened(rig, events.SetInvalidated)] == ["P2"]


async def test_a_replaced_device_is_refused(at_second_point) -> None:
    rig = at_second_point
    known = DeviceIdentity(name="y", protocol="fake", description="a device", serial_number="17")
    history = list(read_journal(rig.folder.journal))
    history[0] = history[0].model_copy(update={"devices": (known,)})
    rig.folder.journal.unlink()
    rig.write(history)
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT), 2)
    with pytest.raises(DeviceError, match="where the run was begun with fake a device, serial number 17"):
        await rig.run(silent, policy=UNATTENDED)


class TestAttendedRun:
    @pytest.mark.parametrize(
        ("choice", "voided"), [(Action.RETRY, 0), (Action.MEASURE_AGAIN, 1), (Action.REDO_SET, 1)]
    )
    async def test_the_recovery_chosen_by_the_operator_is_executed(
        self, at_second_point, choice, voided
    ) -> None:
        rig = at_second_point
        rig.operator.decisions = [choice]
        silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
        assert await until_closed(rig, silent, policy=ATTENDED)
        assert rig.operator.problems == ["gauge y: does not answer"]
        (failure,) = happened(rig, events.Failed)
        assert (failure.action, failure.asked) == (choice, True)
        assert len(happened(rig, events.SetInvalidated)) == voided, (
            "a gauge that was opened again costs the set"
        )

    async def test_an_operator_who_chooses_abort_ends_the_run(self, at_second_point) -> None:
        rig = at_second_point
        rig.operator.decisions = [Action.ABORT]
        silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
        with pytest.raises(GaugeSilent):
            await rig.run(silent, policy=ATTENDED)
        assert happened(rig, events.Interrupted)[-1].exit_code == ExitCode.HARDWARE

    async def test_a_fault_rejects_other_commands_until_it_is_answered(self, at_second_point) -> None:
        rig = at_second_point
        asked = asyncio.Event()

        async def never(*_: Any) -> Action:
            asked.set()
            await asyncio.Event().wait()
            return Action.ABORT

        rig.operator.ask = never
        silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
        running = asyncio.create_task(until_closed(rig, silent, policy=ATTENDED))
        await asked.wait()
        moves = len(rig.controller.log)
        for command in (Resume(), Pause()):
            rig.engine.command(command)
        await until(lambda: len(happened(rig, events.CommandRejected)) == 2)
        assert rig.engine.status is Status.FAULTED
        assert len(rig.controller.log) == moves, "nothing moves under a fault"
        rig.engine.command(Answer("retry"))
        assert await running
        assert [event.command for event in happened(rig, events.CommandRejected)] == ["Resume", "Pause"]

    async def test_a_faulted_run_can_be_aborted(self, at_second_point) -> None:
        rig = at_second_point

        async def leave(*_: Any) -> Action:
            rig.engine.command(Abort())
            await asyncio.Event().wait()
            return Action.RETRY

        rig.operator.ask = leave
        silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
        with pytest.raises(Interruption):
            await rig.run(silent, policy=ATTENDED)


class TestANewGeometryThatCannotBeVerified:
    @pytest.fixture
    def rig(self, recording, replayed) -> Any:
        return replayed(recording.until(events.Proposed))

    def slip(self, rig: Any) -> Any:
        """Every time the last set is about to be closed, a gauge slips farther."""
        real, slipped = rig.gauges[2].shown, [0.0]
        rig.gauges[2].shown = lambda: real() + slipped[0]

        def farther() -> None:
            slipped[0] += 0.3

        return failing("after-V2/close", farther, 100)

    @pytest.mark.parametrize("policy", [GIVE_UP, UNATTENDED])
    async def test_is_rolled_back(self, rig, recording, policy: RecoveryPolicy) -> None:
        with pytest.raises(WriteBackUndone, match=r"could not be verified; .* back\. after-V2: ") as undone:
            await rig.run(self.slip(rig), policy=policy)
        assert undone.value.exit_code is ExitCode.WRITE_BACK_UNDONE
        assert rig.config == recording.config_before
        assert rig.controller.log.count("reload") == 2
        last = read_journal(rig.folder.journal)[-2:]
        assert [event.kind for event in last] == ["rolled back", "interrupted"]
        assert last[1] == events.Interrupted(reason=str(undone.value), exit_code=6)

    async def test_can_be_written_again_by_resuming(self, rig, recording) -> None:
        with pytest.raises(WriteBackUndone):
            await rig.run(self.slip(rig))
        assert (await rig.run()).exit_code == ExitCode.DONE
        assert rig.config == recording.config_after
        assert len(happened(rig, events.Committed)) == 2

    async def test_stays_in_the_controller_after_an_abort_and_is_verified_on_resuming(
        self, rig, recording
    ) -> None:
        abort = failing("after-V2/close", lambda: rig.engine.command(Abort()))
        with pytest.raises(Interruption):
            await rig.run(abort)
        assert rig.config == recording.config_after
        assert fold(read_journal(rig.folder.journal)).is_unverified
        assert (await rig.run()).exit_code == ExitCode.DONE

    async def test_is_written_again_on_resuming_after_a_failed_rollback(self, rig, recording) -> None:
        slip = self.slip(rig)
        rig.controller.failures = {}

        def break_down(event: events.Event, _: RunState) -> None:
            if isinstance(event, events.StepBegun) and event.step.key == "roll back":
                rig.controller.failures["reload"] = DeviceError("does not come back", subject="controller")

        with pytest.raises(SeveralErrors, match="could not be taken back") as both:
            await rig.run(slip, break_down)
        assert both.value.exit_code is ExitCode.HARDWARE
        assert rig.config == recording.config_before
        ended = await rig.run()
        assert ended.exit_code == ExitCode.DONE
        assert rig.config == recording.config_after
