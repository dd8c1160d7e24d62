"""Recovery from a failed step: stop, choose an action by policy or person, prepare the next attempt.

The policy is data: an escalation, a sequence of actions, for every kind of failure (``[recovery]`` in
the cell file). Each attempt is an event, so the state of a run knows which action is next.
"""

from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass

from drivers import errors as device
from hexacell import errors
from hexacell.cell.recovery import Action, Escalations, FailureKind
from procedures.devices.reconnection import reconnect
from procedures.devices.settling import NeverSettled
from procedures.engine.command_loop import CommandLoop, StepCancelled
from procedures.engine.commands import QuestionBroker
from procedures.journal.journal import is_evidence_lost
from procedures.run.keys import SetKey
from procedures.run.questions import ask_recovery
from procedures.run.state import RunState, place_of
from procedures.run.trips import Guard, GuardTripped, RobotNotStopped, causes_of, may_still_move
from procedures.steps import events
from procedures.steps.base import StepOfSet
from procedures.steps.place import MountingError
from procedures.workflow.next_step import StepExecutor
from procedures.workflow.sets import NoSafePath, TravelError

KINDS: Mapping[type[errors.HexacellError], FailureKind] = {
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
    device.ConnectionLost: FailureKind.LINK_LOST,
    device.CommandRefused: FailureKind.CONTROLLER,
    device.MotionInterrupted: FailureKind.CONTROLLER,
    device.PortLost: FailureKind.LINK_LOST,
    NeverSettled: FailureKind.UNSETTLED,
    MountingError: FailureKind.MOUNTING,
    TravelError: FailureKind.GAUGE_AT_END,
    NoSafePath: FailureKind.NO_WAY,
    errors.FileError: FailureKind.FILE,
    errors.DeviceError: FailureKind.OTHER,
}
"""The nearest class that an error belongs to decides; any other is final."""

OF_GUARDS: Mapping[Guard, FailureKind] = {
    Guard.EMERGENCY_STOP: FailureKind.CONTROLLER,
    Guard.CONTROLLER: FailureKind.CONTROLLER,
    Guard.FOLLOWING: FailureKind.CONTROLLER,
    Guard.POSITION: FailureKind.CONTROLLER,
    Guard.GAUGE_END: FailureKind.GAUGE_AT_END,
    Guard.PLATE: FailureKind.GAUGE_AT_END,
    Guard.ENCODERS: FailureKind.ENCODER_SILENT,
    Guard.DRIFT: FailureKind.DRIFT,
    Guard.DISK: FailureKind.FILE,
}
"""Guards that tripped on nothing that a device said; any other is a kind of its own."""


def kind_of(error: errors.HexacellError) -> FailureKind:
    """The kind of one failure."""
    if not isinstance(error, GuardTripped):
        return next((KINDS[base] for base in type(error).__mro__ if base in KINDS), FailureKind.FINAL)
    if error.trip.guard is Guard.STALE:
        is_gauge = error.trip.device.startswith("gauge")
        return FailureKind.GAUGE_SILENT if is_gauge else FailureKind.LINK_LOST
    return OF_GUARDS.get(error.trip.guard, FailureKind.GUARD)


GIVE_UP = Escalations()
"""Every failure ends the run."""


def failed(
    policy: Escalations, error: errors.HexacellError, step: events.Step | None, state: RunState
) -> events.Failed:
    """The event of a failure; of several at once, the one with the most severe action decides."""
    failures: list[events.Failed] = []
    for kind in dict.fromkeys(kind_of(one) for one in causes_of(error)):
        attempt = state.failures.get((kind, place_of(step)), 0) + 1
        action = policy.action(kind, attempt)
        failures.append(
            events.Failed(step=step, failure=kind, attempt=attempt, reason=str(error), action=action)
        )
    return max(failures, key=lambda failure: list(Action).index(failure.action))


def choices(failure: events.Failed) -> tuple[Action, ...]:
    """What a person may choose; where no set is being measured there is none to redo.

    Gauges that are mounted otherwise have another zero, so that their set begins again.
    """
    if failure.failure is FailureKind.MOUNTING:
        return Action.REDO_SET, Action.ABORT
    if failure.step is not None and failure.step.moves_nothing:
        return Action.RETRY, Action.ABORT
    return Action.RETRY, Action.MEASURE_AGAIN, Action.REDO_SET, Action.ABORT


@dataclass(frozen=True, eq=False)
class Recovery:
    """Recovers from the failures of one run.

    Attributes:
        halt: stops motion in place; why it is not certain that the robot has stopped, if it is not.
        record: journals an event and gives the state after it.
    """

    executor: StepExecutor
    commands: CommandLoop
    broker: QuestionBroker
    policy: Escalations
    halt: Callable[[], Awaitable[errors.HexacellError | None]]
    record: Callable[[events.Event], RunState]

    async def recover(self, error: errors.HexacellError, step: events.Step | None, state: RunState) -> None:
        """Return when the next step may be decided; raises the error that ends the run otherwise.

        A failure meanwhile is a failure of its own.
        """
        while True:
            failure = failed(self.policy, error, step, state)
            self.commands.set_flags(fault=str(error))
            if failure.action is Action.ABORT:
                raise error
            if stop_failure := await self.halt():
                if failure.action is not Action.ASK:
                    raise error  # without a person nothing is tried while the robot may still move
                unstopped = error if may_still_move(error) else RobotNotStopped(stop_failure, error)
                failure = failure.model_copy(update={"reason": str(unstopped)})
            if (decided := await self._decide(failure, error)) is None:
                raise error
            if isinstance(error, GuardTripped) and not decided.asked:
                self.record(events.Tripped.of(error.trip))
            state = self.record(decided)
            self.commands.set_flags(fault=None)
            try:
                with suppress(StepCancelled):
                    for event in await self.commands.run_cancellable(self._prepare(error, decided, state)):
                        state = self.record(event)
            except errors.HexacellError as another:
                error = another
            else:
                return

    async def _decide(self, failure: events.Failed, error: errors.HexacellError) -> events.Failed | None:
        """The failure with the action to take, chosen by a person if need be; None to end the run."""
        if failure.action is not Action.ASK:
            return failure
        if isinstance(error, GuardTripped):
            self.record(events.Tripped.of(error.trip))
        self.record(failure)  # when it was, not only when it is answered
        question = ask_recovery(failure.reason, choices(failure))
        try:
            action = Action(str(await self.commands.run_cancellable(self.broker.ask(question))))
        except errors.AnswerNeeded:
            return None
        except StepCancelled:
            if reason := self.commands.flags.stopping:
                raise errors.Interruption(reason) from None
            return None
        if action is Action.ABORT:
            return None
        return failure.model_copy(update={"action": action, "asked": True})

    async def _prepare(
        self, error: errors.HexacellError, failure: events.Failed, state: RunState
    ) -> list[events.SetInvalidated]:
        """Wait, reconnect lost devices, and give the sets that are invalid by that or by the action."""
        if not failure.asked:
            await self.executor.clock.sleep(self.executor.settings.recovery.wait_s)
        keys, reason, step = list[SetKey](), failure.reason, failure.step
        if failure.action is Action.REDO_SET:  # of a step without a set of its own, all that are open
            keys = [key for key in state.open_sets if not isinstance(step, StepOfSet) or key == step.at]
        if failure.action is not Action.RETRY:
            known = state.started.devices if state.started else ()
            if await reconnect(self.executor.devices, error, known):
                keys, reason = state.sets_with_zero, "a gauge was opened again, its zero is void"
        return [events.SetInvalidated(at=key, reason=reason) for key in keys]


@dataclass(frozen=True, slots=True)
class Reversal:
    """A change of the config to revert although no decision of the procedure asks for it.

    Attributes:
        step: the step that reverts it.
        failure: what to report if that fails; empty if the next resumption tries again.
        is_recorded: whether the step is journalled, as any other is.
    """

    step: events.BaseStep
    failure: str
    is_recorded: bool = True

    def undone(self, error: BaseException) -> BaseException:
        """The error to report once it is reverted: of a written result, that it was undone, and why."""
        is_result = isinstance(self.step, events.RollBack) and (self.is_recorded or is_evidence_lost(error))
        if not is_result or not isinstance(error, errors.HexacellError) or may_still_move(error):
            return error
        undone = "the new geometry was written and could not be verified; the old config is back."
        if is_evidence_lost(error):  # no journal says so: it cannot be resumed
            return errors.WriteBackUndone(f"{undone} {error.cause}", action="Begin a new run")
        return errors.WriteBackUndone(f"{undone} {error}")

    def failed(self, cause: BaseException, error: errors.HexacellError) -> BaseException:
        """The error to report if it cannot be reverted: the cause, and why, unless a resumption may."""
        if not self.failure or not isinstance(cause, errors.HexacellError):
            return cause
        return errors.SeveralErrors(self.failure, [cause, error])


def revert_unrecorded(event: events.BaseEvent, state: RunState) -> Reversal | None:
    """What to revert if an event could not be journalled; ``state`` is the one without it."""
    failure = "the controller has {}, which could be neither noted nor taken back"
    if isinstance(event, events.Committed) and state.committed is None:
        return Reversal(events.RollBack(), failure.format("the new geometry"), is_recorded=False)
    if isinstance(event, events.ProvisionalApplied) and not state.provisional_active:
        return Reversal(events.TakeBack(), failure.format("a provisional geometry"), is_recorded=False)
    return None


def revert_at_end(state: RunState, error: BaseException) -> Reversal | None:
    """What to revert if an error ends the run.

    A result that was not verified is reverted after a failure; a person who interrupts may resume and
    verify it. A provisional geometry is reverted where the robot is at a reference. At other poses the
    joint variables may belong to no pose of the old geometry; the resumed run reverts it. Where the journal
    itself is lost, nothing can be recorded in it.
    """
    is_recorded = not is_evidence_lost(error)
    is_failure = isinstance(error, errors.HexacellError) and not isinstance(error, errors.Interruption)
    if is_failure and state.is_unverified:
        failure = "the new geometry was not verified, and could not be taken back"
        return Reversal(events.RollBack(), failure, is_recorded)
    is_at_reference = state.at_pose is not None and state.at_pose[1] == 1
    if state.config_write_pending or (state.provisional_active and is_at_reference):
        return Reversal(events.TakeBack(), "", is_recorded)
    return None
