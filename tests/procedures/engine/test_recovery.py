"""Recovery from failures of devices: what an unattended run tries, a person chooses, the policy says."""

import asyncio
import re
from typing import Any

import pytest

from drivers import errors as faults
from hexacell import errors
from hexacell.cell.recovery import Action, Escalations, FailureKind
from procedures.devices.settling import NeverSettled
from procedures.engine.command_loop import Status
from procedures.engine.commands import Answer, Pause, Resume
from procedures.engine.recovery import GIVE_UP, failed, kind_of
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.run.trips import DriftTripped, Guard, Trip
from procedures.steps import events
from procedures.steps.sample import Sample
from procedures.workflow.sets import NoSafePath, TravelError
from tests.procedures.runs.listening import (
    ATTENDED,
    KEY,
    SILENT,
    UNATTENDED,
    failing,
    happened,
    until_closed,
)
from tests.waiting import until


@pytest.fixture
def rig(recording, replayed) -> Any:
    """One point measured; the second one gets four records only, which is enough to go wrong in."""
    return replayed(recording.until(events.SetClosed, count=1), identification__orientations=4)


@pytest.mark.parametrize(("times", "reopened", "voided"), [(1, 0, 0), (3, 2, 2)])
async def test_an_unattended_run_retries_a_silent_gauge_and_then_redoes_its_set(
    rig, times: int, reopened: int, voided: int
) -> None:
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT), times)
    assert await until_closed(rig, silent, policy=UNATTENDED)
    assert [event.attempt for event in happened(rig, events.Failed)] == list(range(1, times + 1))
    assert rig.gauges[1].closed == reopened
    assert [str(event.at) for event in happened(rig, events.SetInvalidated)] == ["P2"] * voided
    assert rig.gauges[0].closed == 0, "the others are left alone"


def jumped_while_away(rig: Any, jump_mm: float) -> Any:
    """The bus of the encoders is lost at a record; that of leg 3 comes back with another zero."""
    encoders, shown = rig.bench.encoders, rig.bench.encoders.shown

    def unplug() -> None:
        encoders.failure = faults.BusError("has died", subject="encoder bus")

    async def back() -> Any:
        encoders.failure = None
        encoders.shown = lambda: [q + jump_mm * (leg == 3) for leg, q in enumerate(shown(), 1)]
        return encoders._answering("encoder 1")

    encoders.open = back
    return failing(KEY, unplug)


async def test_after_a_lost_encoder_bus_the_reference_is_confirmed_again(rig) -> None:
    assert await until_closed(rig, jumped_while_away(rig, 0.0), policy=UNATTENDED)
    (failure,) = happened(rig, events.Failed)
    assert (failure.failure, failure.action) == (FailureKind.LINK_LOST, Action.MEASURE_AGAIN)
    assert [str(event.at) for event in happened(rig, events.ReferenceConfirmed)] == ["P2"]
    assert not happened(rig, events.SetInvalidated)


async def test_an_encoder_that_jumped_while_it_was_away_is_named(rig) -> None:
    with pytest.raises(
        errors.HexacellError, match=r"encoder 3: shows slider 3 at .* See whether it slipped"
    ):
        await rig.run(jumped_while_away(rig, 3.0), policy=UNATTENDED)
    assert "P2" not in [str(event.at) for event in happened(rig, events.ReferenceConfirmed)]


async def test_a_small_jump_while_it_was_away_costs_the_set(rig) -> None:
    assert await until_closed(rig, jumped_while_away(rig, 0.2), policy=UNATTENDED)
    (invalidated,) = happened(rig, events.SetInvalidated)
    assert str(invalidated.at) == "P2"
    shown = re.match(r"back at its reference q3 shows (\+[\d.]+)( mm)?, more than", invalidated.reason)
    assert shown is not None
    assert float(shown[1]) == pytest.approx(0.2, abs=0.01)


async def test_a_device_that_cannot_be_reopened_ends_the_run(rig) -> None:
    encoders = rig.bench.encoders
    encoders_lost = faults.BusError("has died", subject="encoder bus")

    def unplug() -> None:
        encoders.failure = encoders.dead = encoders_lost

    with pytest.raises(faults.BusError):
        await rig.run(failing(KEY, unplug), policy=UNATTENDED)
    assert len(happened(rig, events.Failed)) == 3


async def test_a_void_zero_invalidates_the_set(rig) -> None:
    gauge = rig.gauges[0]
    void = faults.ZeroVoid("was off in between", subject="gauge x")

    def switch_off() -> None:
        gauge.void = void

    async def back() -> Any:
        gauge.void = None
        return gauge._answering("x")[0]

    gauge.open = back
    assert await until_closed(rig, failing("P2/close", switch_off), policy=UNATTENDED)
    (voided,) = happened(rig, events.SetInvalidated)
    assert voided.reason == "a gauge was opened again, its zero is void"


async def test_a_robot_that_cannot_be_stopped_ends_the_run_without_recovery(rig) -> None:

    def break_down() -> None:
        rig.gauges[1].failures.append(SILENT)
        rig.controller.failures["stop"] = errors.DeviceError("could not be stopped", subject="controller")

    with pytest.raises(faults.GaugeSilent):
        await rig.run(failing(KEY, break_down), policy=UNATTENDED)
    assert not happened(rig, events.Failed)


@pytest.mark.parametrize(
    ("choice", "voided"), [(Action.RETRY, 0), (Action.MEASURE_AGAIN, 1), (Action.REDO_SET, 1)]
)
async def test_the_recovery_chosen_by_the_operator_is_executed(rig, choice, voided) -> None:
    rig.operator.decisions = [choice]
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
    assert await until_closed(rig, silent, policy=ATTENDED)
    assert rig.operator.problems == ["gauge y: does not answer"]
    failures = [(one.action, one.asked, one.attempt) for one in happened(rig, events.Failed)]
    assert failures == [(Action.ASK, False, 1), (choice, True, 1)]
    assert len(happened(rig, events.SetInvalidated)) == voided, "one that was opened again costs it"


async def test_a_fault_rejects_other_commands_until_it_is_answered(rig) -> None:
    asked = asyncio.Event()

    async def never(*_: Any) -> Action:
        asked.set()
        await asyncio.Event().wait()
        return Action.ABORT

    rig.operator.ask = never
    silent = failing(KEY, lambda: rig.gauges[1].failures.append(SILENT))
    running = asyncio.create_task(until_closed(rig, silent, policy=ATTENDED))
    await asked.wait()
    (told,) = happened(rig, events.Failed)
    assert told.action is Action.ASK, "it is in the journal when it happens"
    moves = len(rig.controller.log)
    for command in (Resume(), Pause()):
        rig.engine.queue.put(command)
    await until(lambda: len(happened(rig, events.CommandRejected)) == 2)
    assert rig.engine.status is Status.FAULTED
    assert len(rig.controller.log) == moves, "nothing moves under a fault"
    rig.engine.queue.put(Answer("retry"))
    assert await running
    assert [event.command for event in happened(rig, events.CommandRejected)] == ["Resume", "Pause"]


P1 = SetKey(phase=Phase.IDENTIFY, point=1)
STEP = Sample(at=P1, orientation=2, pose=(0.0,) * 6)


class TrippedGuard(errors.DeviceError):
    """As another part of the program may define it."""


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (faults.GaugeSilent("does not answer"), FailureKind.GAUGE_SILENT),
        (faults.GaugeUnsteady("swings"), FailureKind.UNSETTLED),
        (NeverSettled("moves"), FailureKind.UNSETTLED),
        (faults.GaugeAtEnd("at its end"), FailureKind.GAUGE_AT_END),
        (TravelError("at its end"), FailureKind.GAUGE_AT_END),
        (faults.WrongSetting("inch"), FailureKind.GAUGE_SETTING),
        (faults.ZeroVoid("was off"), FailureKind.ZERO_VOID),
        (faults.SilentNodeError("silent"), FailureKind.ENCODER_SILENT),
        (faults.InvalidSampleError("no magnet"), FailureKind.ENCODER_ALARM),
        (faults.RestartedNodeError("booted"), FailureKind.ENCODER_RESTARTED),
        (faults.BusError("died"), FailureKind.LINK_LOST),
        (faults.PortLost("port /dev/x was lost"), FailureKind.LINK_LOST),
        (faults.ConnectionLost("gone"), FailureKind.LINK_LOST),
        (faults.ResponseTimeout("late"), FailureKind.LINK_LOST),
        (faults.MoveRefused("to move", "limits", subject="controller"), FailureKind.CONTROLLER),
        (faults.MotionInterrupted("stopped elsewhere"), FailureKind.CONTROLLER),
        (DriftTripped(Trip(Guard.DRIFT, "P1", "drifted", "Resume")), FailureKind.DRIFT),
        (NoSafePath("no way"), FailureKind.NO_WAY),
        (errors.FileError("disk full"), FailureKind.FILE),
        (TrippedGuard("following error"), FailureKind.OTHER),
        (errors.LimitError("declined"), FailureKind.FINAL),
        (errors.AnswerNeeded("nobody"), FailureKind.FINAL),
        (errors.WriteBackUndone("undone"), FailureKind.FINAL),
        (errors.UsageError("unknown"), FailureKind.FINAL),
    ],
)
def test_the_class_of_an_error_decides_its_kind(error: errors.HexacellError, kind: FailureKind) -> None:
    assert kind_of(error) is kind


@pytest.mark.parametrize("policy", [ATTENDED, UNATTENDED, GIVE_UP])
@pytest.mark.parametrize("kind", FailureKind)
def test_every_escalation_ends(policy: Escalations, kind: FailureKind) -> None:
    assert policy.action(kind, 1000) in {Action.ASK, Action.ABORT}
    assert policy.action(FailureKind.FINAL, 1) is Action.ABORT


def test_only_an_attended_run_asks_and_it_always_does() -> None:
    kinds = [kind for kind in FailureKind if kind is not FailureKind.FINAL]
    assert all(ATTENDED.action(kind, 1) is Action.ASK for kind in kinds)
    assert all(UNATTENDED.action(kind, n) is not Action.ASK for kind in kinds for n in range(1, 9))


def test_attempts_are_counted_by_kind_and_set_since_the_last_interruption() -> None:
    silent, drift = faults.GaugeSilent("silent"), DriftTripped(Trip(Guard.DRIFT, "P1", "drifted", "Resume"))
    told: list[events.Event] = []
    for error in (silent, silent, drift, silent, silent):
        told.append(failed(UNATTENDED, error, STEP, fold(told)))
    actions = [(event.attempt, event.action.value) for event in told if isinstance(event, events.Failed)]
    assert actions == [(1, "retry"), (2, "redo-set"), (1, "redo-set"), (3, "redo-set"), (4, "abort")]
    told.append(events.Interrupted(reason="x", exit_code=3))
    assert failed(UNATTENDED, silent, STEP, fold(told)).attempt == 1


def test_the_most_serious_of_several_failures_determines_the_action() -> None:
    several = errors.SeveralErrors("two", [faults.GaugeSilent("silent"), faults.WrongSetting("inch")])
    failure = failed(UNATTENDED, several, STEP, RunState())
    assert (failure.failure, failure.action) == (FailureKind.GAUGE_SETTING, Action.ABORT)
