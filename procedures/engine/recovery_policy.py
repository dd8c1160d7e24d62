"""The action after a failure: by its kind, by how often it occurred, and by whether a person is present.

The policy is data: an escalation, a sequence of actions, for every kind of failure (``[recovery]`` in
the cell file). Each attempt is an event, so the state of a run knows which action is next.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from drivers import errors as device
from drivers.controllers import errors as controller
from hexacell.cell.recovery import (
    Action,
    AttendedRecovery,
    FailureKind,
    RecoverySettings,
    UnattendedRecovery,
)
from hexacell.errors import DeviceError, FileError, HexacellError
from procedures.calibration.path_planning import NoSafePath
from procedures.calibration.set_steps import TravelError
from procedures.devices.settling import NeverSettled
from procedures.run import events
from procedures.run.state import RunState
from procedures.run.steps import Compute, Step
from procedures.run.trips import Guard, GuardTripped, Trip, causes_of

KINDS: Mapping[type[HexacellError], FailureKind] = {
    device.GaugeSilent: FailureKind.GAUGE_SILENT,
    device.WrongAnswer: FailureKind.GAUGE_SILENT,
    device.WrongSetting: FailureKind.GAUGE_SETTING,
    device.GaugeAtEnd: FailureKind.GAUGE_AT_END,
    device.GaugeUnsteady: FailureKind.UNSETTLED,
    device.ZeroVoid: FailureKind.ZERO_VOID,
    device.SilentNodeError: FailureKind.ENCODER_SILENT,
    device.InvalidSampleError: FailureKind.ENCODER_ALARM,
    device.RestartedNodeError: FailureKind.ENCODER_RESTARTED,
    device.BusError: FailureKind.LINK_LOST,
    controller.ConnectionLost: FailureKind.LINK_LOST,
    controller.CommandRefused: FailureKind.CONTROLLER,
    controller.MotionInterrupted: FailureKind.CONTROLLER,
    device.PortLost: FailureKind.LINK_LOST,
    NeverSettled: FailureKind.UNSETTLED,
    TravelError: FailureKind.GAUGE_AT_END,
    NoSafePath: FailureKind.NO_WAY,
    FileError: FailureKind.FILE,
    DeviceError: FailureKind.OTHER,
}
"""The nearest class that an error belongs to decides; any other is final."""

OF_GUARDS: Mapping[Guard, FailureKind] = {
    Guard.CONTROLLER: FailureKind.CONTROLLER,
    Guard.FOLLOWING: FailureKind.CONTROLLER,
    Guard.GAUGE_END: FailureKind.GAUGE_AT_END,
    Guard.PLATE: FailureKind.GAUGE_AT_END,
    Guard.ENCODERS: FailureKind.ENCODER_SILENT,
    Guard.DRIFT: FailureKind.DRIFT,
    Guard.DISK: FailureKind.FILE,
}
"""Guards that tripped on nothing that a device said; any other is a kind of its own."""

SEVERITY = (Action.RETRY, Action.MEASURE_AGAIN, Action.REDO_SET, Action.ASK, Action.ABORT)


def kind_of(error: HexacellError) -> FailureKind:
    """The kind of one failure."""
    if isinstance(error, GuardTripped):
        return _kind_of_trip(error.trip)
    return next((KINDS[base] for base in type(error).__mro__ if base in KINDS), FailureKind.FINAL)


def _kind_of_trip(trip: Trip) -> FailureKind:
    if trip.guard is Guard.STALE:
        return FailureKind.GAUGE_SILENT if trip.device.startswith("gauge") else FailureKind.LINK_LOST
    return OF_GUARDS.get(trip.guard, FailureKind.GUARD)


@dataclass(frozen=True, slots=True)
class RecoveryPolicy:
    """The actions after the failures of a run.

    Attributes:
        escalations: by kind; a kind without one ends the run.
        wait_s: cell seconds before a device is tried again.
    """

    escalations: Mapping[FailureKind, tuple[Action, ...]]
    wait_s: float = 0.0

    @classmethod
    def of(cls, settings: RecoverySettings, *, attended: bool) -> RecoveryPolicy:
        """The policy that a cell file states."""
        rules: AttendedRecovery | UnattendedRecovery = (
            settings.attended if attended else settings.unattended
        )
        kinds = (kind for kind in FailureKind if kind is not FailureKind.FINAL)
        return cls({kind: rules.escalation(kind) for kind in kinds}, settings.wait_s)

    def action(self, kind: FailureKind, attempt: int) -> Action:
        """The action after the ``attempt``-th failure of a kind, counted from 1."""
        escalation = self.escalations.get(kind, (Action.ABORT,))
        return escalation[min(attempt, len(escalation)) - 1]


GIVE_UP = RecoveryPolicy({})
"""Every failure ends the run."""


def failed(
    policy: RecoveryPolicy, error: HexacellError, step: Step | None, state: RunState
) -> events.Failed:
    """The event of a failure; of several at once, the one with the most severe action decides."""
    verdicts = (_verdict(policy, kind, step, state) for kind in _kinds(error))
    kind, attempt, action = max(verdicts, key=lambda verdict: SEVERITY.index(verdict[2]))
    return events.Failed(step=step, failure=kind, attempt=attempt, reason=str(error), action=action)


def choices(failure: events.Failed) -> tuple[Action, ...]:
    """What a person may choose; where no set is being measured there is none to redo."""
    if isinstance(failure.step, Compute):
        return Action.RETRY, Action.ABORT
    return Action.RETRY, Action.MEASURE_AGAIN, Action.REDO_SET, Action.ABORT


def _kinds(error: HexacellError) -> Iterable[FailureKind]:
    return dict.fromkeys(kind_of(one) for one in causes_of(error))


def _verdict(
    policy: RecoveryPolicy, kind: FailureKind, step: Step | None, state: RunState
) -> tuple[FailureKind, int, Action]:
    attempt = state.failures.get((kind.value, events.place_of(step)), 0) + 1
    return kind, attempt, policy.action(kind, attempt)
