"""Recovery from a failed step: stop, choose an action by policy or person, prepare the next attempt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from hexacell.cell.recovery import Action
from hexacell.errors import AnswerNeeded, HexacellError, Interruption
from procedures.devices.reconnection import reconnect
from procedures.engine.command_loop import CommandLoop, StepCancelled
from procedures.engine.recovery_policy import RecoveryPolicy, choices, failed
from procedures.engine.step_executor import StepExecutor
from procedures.run import events
from procedures.run.questions import QuestionBroker, ask_recovery
from procedures.run.state import RunState
from procedures.run.steps import SetKey, Step


class ActiveRun(Protocol):
    """What recovery needs of the engine."""

    state: RunState

    def record(self, event: events.Event) -> None:
        """Journal an event."""
        ...

    def record_trip(self, error: BaseException) -> None:
        """Journal the guard that tripped, if the error is one."""
        ...

    async def halt(self) -> bool:
        """Stop motion in place; whether it is certain that the robot has stopped."""
        ...


@dataclass(frozen=True, eq=False)
class Recovery:
    """Recovers from the failures of one run."""

    executor: StepExecutor
    commands: CommandLoop
    broker: QuestionBroker
    policy: RecoveryPolicy

    async def recover(self, run: ActiveRun, error: HexacellError, step: Step | None) -> None:
        """Return when the next step may be decided; a failure meanwhile is a failure of its own.

        Raises:
            HexacellError: the failure that ends the run.
        """
        while True:
            failure = failed(self.policy, error, step, run.state)
            self.commands.set_flags(fault=str(error))
            if failure.action is Action.ABORT:
                raise error
            if not await run.halt() and failure.action is not Action.ASK:
                raise error  # without a person nothing is tried while the robot may still move
            if (decided := await self._decide(failure)) is None:
                raise error
            run.record_trip(error)
            run.record(decided)
            self.commands.set_flags(fault=None)
            try:
                for event in await self.commands.run_cancellable(self.prepare(error, decided, run.state)):
                    run.record(event)
            except StepCancelled:
                return
            except HexacellError as another:
                error = another
            else:
                return

    async def _decide(self, failure: events.Failed) -> events.Failed | None:
        """The failure with the action to take, chosen by a person if need be; None to end the run."""
        if failure.action is not Action.ASK:
            return failure
        question = ask_recovery(failure.reason, choices(failure))
        try:
            action = Action(str(await self.commands.run_cancellable(self.broker.ask(question))))
        except AnswerNeeded:
            return None
        except StepCancelled:
            if reason := self.commands.flags.stopping:
                raise Interruption(reason) from None
            return None
        if action is Action.ABORT:
            return None
        return failure.model_copy(update={"action": action, "asked": True})

    async def prepare(
        self, error: HexacellError, failure: events.Failed, state: RunState
    ) -> list[events.SetInvalidated]:
        """Wait, reconnect lost devices, and give the sets that are invalid by that or by the action.

        Raises:
            HexacellError: a device does not come back, or another one answers.
        """
        if not failure.asked:
            await self.executor.clock.sleep(self.policy.wait_s)
        is_zero_lost = False
        if failure.action is not Action.RETRY:
            known = state.started.devices if state.started else ()
            is_zero_lost = await reconnect(self.executor.devices, error, known)
        if is_zero_lost:
            return _invalidated(_open_sets(state), "a gauge was opened again, its zero is void")
        if failure.action is Action.REDO_SET:
            return _invalidated(_failed_sets(failure, state), failure.reason)
        return []


def _invalidated(keys: Sequence[SetKey], reason: str) -> list[events.SetInvalidated]:
    return [events.SetInvalidated(at=key, reason=reason) for key in keys]


def _failed_sets(failure: events.Failed, state: RunState) -> list[SetKey]:
    """The set of the failed step; all open sets if it has none."""
    key = getattr(failure.step, "at", None)
    return [one for one in _open_sets(state) if key is None or one == key]


def _open_sets(state: RunState) -> list[SetKey]:
    return [key for key, measured in state.sets.items() if not measured.closed]
