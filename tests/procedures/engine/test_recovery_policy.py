"""The policy of recovery: the kind of an error, escalations that end, counted attempts."""

from __future__ import annotations

import pytest

from drivers.errors import (
    BusError,
    ConnectionLost,
    GaugeAtEnd,
    GaugeSilent,
    GaugeUnsteady,
    InvalidSampleError,
    MotionInterrupted,
    MoveRefused,
    PortLost,
    ResponseTimeout,
    RestartedNodeError,
    SilentNodeError,
    WrongSetting,
    ZeroVoid,
)
from hexacell.cell.recovery import Action, FailureKind
from hexacell.errors import (
    AnswerNeeded,
    DeviceError,
    FileError,
    HexacellError,
    LimitError,
    SeveralErrors,
    UsageError,
    WriteBackUndone,
)
from procedures.devices.settling import NeverSettled
from procedures.engine.recovery import GIVE_UP, RecoveryPolicy, failed, kind_of
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, fold
from procedures.run.trips import DriftTripped, Guard, Trip
from procedures.steps import events
from procedures.steps.sample import Sample
from procedures.workflow.sets import NoSafePath, TravelError
from tests.procedures.runs.listening import ATTENDED, UNATTENDED

P1 = SetKey(phase=Phase.IDENTIFY, point=1)
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
