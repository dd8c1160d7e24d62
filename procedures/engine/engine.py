"""The engine: decide, write down, do, write down, until there is nothing left to do."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import reduce

from hexacell.cell.recovery import Action
from hexacell.errors import AnswerNeeded, ExitCode, HexacellError, Interruption, SeveralErrors, UsageError
from procedures.engine.command_loop import CommandLoop, StepCancelled
from procedures.engine.operator import QuestionBroker, UnattendedOperator
from procedures.engine.recovery_actions import prepare_retry
from procedures.engine.recovery_policy import GIVE_UP, RecoveryPolicy, choices, failed
from procedures.engine.step_executor import StepExecutor
from procedures.journal.journal import Journal
from procedures.run import events
from procedures.run.cancellation import shielded
from procedures.run.commands import Command, CommandQueue, MeasureAgain, Undo
from procedures.run.questions import Question, ask_recovery
from procedures.run.result import ending, exit_code
from procedures.run.state import RunState, apply, fold
from procedures.run.status import Status
from procedures.run.steps import Compute, Phase, Step
from procedures.run.trips import GuardTripped
from procedures.run.undo import invalidation_event

Listener = Callable[[events.Event, RunState], None]

_KILLED = int(ExitCode.INTERRUPTED)
_IN_A_RECORD = (events.Located, events.Arrived, events.GaugesPlaced)
"""After these a record is still being taken; a pause after the record waits."""


class Engine:
    """One run, from where its journal stands to its end.

    Faces learn what happened through listeners, which are called after each event is on the disk,
    and what the engine is doing through ``status`` and ``watch``; they tell it what to do through
    ``command``. Questions are put through ``desk``, which the performer's operator should be.
    """

    def __init__(
        self,
        performer: StepExecutor,
        journal: Journal,
        listeners: Sequence[Listener] = (),
        *,
        inbox: CommandQueue | None = None,
        desk: QuestionBroker | None = None,
        policy: RecoveryPolicy = GIVE_UP,
    ) -> None:
        self._performer = performer
        self._journal = journal
        self._listeners = tuple(listeners)
        self._inbox = inbox or CommandQueue()
        self._desk = desk or QuestionBroker(UnattendedOperator())
        self._policy = policy
        self._attention = CommandLoop(
            self._inbox, self._desk, supersede=self._supersede, decline=self._declined
        )
        self._superseded: list[events.RecordDiscarded | events.SetInvalidated] = []
        self._prepared = False
        self._last: events.Event | None = None
        self.state = fold(journal.events)

    @property
    def status(self) -> Status:
        """What the engine is doing now."""
        return self._attention.situation.status

    @property
    def question(self) -> Question | None:
        """The question that waits for an :class:`~procedures.run.commands.Answer`, if one does."""
        return self._desk.open

    def watch(self, watcher: Callable[[Status], None]) -> None:
        """Have somebody hear of every new status."""
        self._attention.watchers.append(watcher)

    def command(self, command: Command) -> None:
        """Tell the engine something, from any thread; see :mod:`procedures.run.commands`."""
        self._inbox.put(command)

    async def run(self) -> events.Ended:
        """Do all that is left.

        Whatever stops it, motion stops in place and the journal says so before the error goes on. A
        geometry that was written and could not be verified is taken back.

        Raises:
            Interruption: somebody ended it before it was over.
            HexacellError: a step could not be done, and the policy knew no way on.
        """
        self._attention.set_flags(begun=True)
        try:
            with self._inbox.attended():
                while await self._went_on():
                    pass
        except BaseException as error:
            await self._stop(error)
            raise
        finally:
            self._attention.set_flags(ended=True)
        return self._end()

    def reopen_sets(self) -> None:
        """Take up what an interruption left open: what cannot be continued is given up.

        A run that ended without a word, by a kill or a power cut, left the robot nobody knows where.
        """
        if self.state.target is not None and not self.state.position_unknown:
            self.tell(events.Interrupted(reason="the program ended without a word", exit_code=_KILLED))
        for key, measured in list(self.state.sets.items()):
            in_vain = not measured.samples or (measured.refusals and key.phase is Phase.BEFORE)
            if in_vain and not measured.closed:
                self.tell(events.SetInvalidated(at=key, reason="the run was interrupted in this set"))

    def tell(self, event: events.Event) -> None:
        """Write an event down, then let everybody know."""
        self._journal.append(event)
        self.state = apply(self.state, event)
        self._last = event
        for listener in self._listeners:
            listener(event, self.state)

    async def _went_on(self) -> bool:
        """Decide on a step and do it; whether there was one."""
        await self._heed()
        step: Step | None = None
        try:
            await self._prepare()
            step = await self._attention.run_cancellable(self._next())
            if step is None:
                return False
            self.tell(events.StepBegun(step=step))
            await self._note(
                await self._attention.run_cancellable(self._performer.perform(step, self.state))
            )
        except StepCancelled:
            pass
        except HexacellError as error:
            await self._recover(error, step)
        return True

    async def _note(self, event: events.Event) -> None:
        """Write down what a step caused; a geometry whose writing cannot be noted is taken back.

        Raises:
            HexacellError: it could not be noted.
            SeveralErrors: nor could the geometry be taken back.
        """
        try:
            self.tell(event)
        except HexacellError as error:
            if isinstance(event, events.Committed) and self.state.committed is None:
                await self._undo(Compute(kind="roll back"), "the new geometry", error)
            if isinstance(event, events.ProvisionalApplied) and not self.state.lending:
                await self._undo(Compute(kind="take back"), "a provisional geometry", error)
            raise

    async def _undo(self, step: Compute, what: str, cause: HexacellError) -> None:
        try:
            await shielded(self._performer.perform(step, self.state))
        except HexacellError as error:
            problem = f"the controller has {what}, which could be neither noted nor taken back"
            raise SeveralErrors(problem, [cause, error]) from cause

    async def _prepare(self) -> None:
        if not self._prepared:
            await self._attention.run_cancellable(self._performer.prepare())
            self._prepared = True

    async def _next(self) -> Step | None:
        return await asyncio.to_thread(self._performer.calibration.next_step, self.state)

    async def _heed(self) -> None:
        """Between two steps: do what was asked for meanwhile."""
        self._attention.catch_up()
        self._tell_superseded()
        now = self._attention.situation
        self._leave_if_told()
        if now.pausing and (now.at_once or not isinstance(self._last, _IN_A_RECORD)):
            await self._rest(at_once=now.at_once)

    async def _rest(self, *, at_once: bool) -> None:
        if at_once:
            self._prepared = False
            await shielded(self._performer.devices.controller.stop())
        self.tell(events.Paused(at_once=at_once))
        self._attention.set_flags(pausing=False, at_once=False, resting=True)
        while self._attention.situation.resting:
            await self._attention.take_one()
            self._tell_superseded()
            self._leave_if_told()
        self.tell(events.Resumed())

    def _leave_if_told(self) -> None:
        if reason := self._attention.situation.stopping:
            raise Interruption(reason)

    def _supersede(self, command: Undo | MeasureAgain) -> str | None:
        """Note what a person sees now, whatever is recorded until it can be obeyed."""
        try:
            self._superseded.append(
                invalidation_event(command, reduce(apply, self._superseded, self.state))
            )
        except UsageError as refusal:
            return str(refusal)
        return None

    def _tell_superseded(self) -> None:
        waiting, self._superseded = self._superseded, []
        for event in waiting:
            if self.state.set(event.at).samples:
                self.tell(event)

    def _declined(self, command: Command, reason: str) -> None:
        self.tell(events.CommandRejected(command=type(command).__name__, reason=reason))

    async def _recover(self, error: HexacellError, step: Step | None) -> None:
        """Find a way on after a failure; what goes wrong on the way is a failure of its own.

        Raises:
            HexacellError: the failure, where there is none.
        """
        while True:
            failure = failed(self._policy, error, step, self.state)
            self._attention.set_flags(fault=str(error))
            if failure.action is Action.ABORT:
                raise error
            if not await self._halt() and failure.action is not Action.ASK:
                raise error  # a robot that may still move is nothing to try again with
            if (decided := await self._decided(failure)) is None:
                raise error
            self._tell_trip(error)
            self.tell(decided)
            self._attention.set_flags(fault=None)
            try:
                await self._mend(error, decided)
            except StepCancelled:
                return
            except HexacellError as another:
                error = another
            else:
                return

    async def _decided(self, failure: events.Failed) -> events.Failed | None:
        """The failure with what follows it, a person asked if need be; nothing where the run ends."""
        if failure.action is not Action.ASK:
            return failure
        try:
            question = ask_recovery(failure.reason, choices(failure))
            answer = await self._attention.run_cancellable(self._desk.ask(question))
            action = Action(str(answer))
        except AnswerNeeded:
            return None
        except StepCancelled:
            self._leave_if_told()
            return None
        return (
            None if action is Action.ABORT else failure.model_copy(update={"action": action, "asked": True})
        )

    async def _mend(self, error: HexacellError, failure: events.Failed) -> None:
        self._prepared = False
        told = await self._attention.run_cancellable(
            prepare_retry(self._performer, self._policy, error, failure, self.state)
        )
        for event in told:
            self.tell(event)

    def _tell_trip(self, error: BaseException) -> None:
        if isinstance(error, GuardTripped):
            self.tell(events.Tripped.of(error.trip))

    async def _halt(self) -> bool:
        """Stop motion in place; whether it is certain that it has stopped."""
        self._prepared = False
        try:
            await shielded(self._performer.devices.controller.stop())
        except HexacellError:
            return False
        return True

    async def _stop(self, error: BaseException) -> None:
        reason = str(error) or type(error).__name__
        try:
            await self._halt()
            with suppress(HexacellError):
                self._tell_trip(error)
            if isinstance(error, HexacellError) and not isinstance(error, Interruption):
                await self._withdraw(error)
            await self._take_back()
        finally:
            with suppress(HexacellError):
                self.tell(events.Interrupted(reason=reason, exit_code=int(exit_code(error))))

    async def _take_back(self) -> None:
        """Leave no provisional geometry in the controller where the robot stands level.

        Elsewhere the sliders may belong to no pose of the old one; whoever resumes has it taken back.
        """
        standing = self.state.standing
        if (self.state.lending and standing and standing[1] == 1) or self.state.config_write_pending:
            step = Compute(kind="take back")
            with suppress(HexacellError):
                self._performer.guards.watch.clear()
                self.tell(events.StepBegun(step=step))
                self.tell(await shielded(self._performer.perform(step, self.state)))

    async def _withdraw(self, cause: HexacellError) -> None:
        """Take back a geometry that stands in the controller and can no longer be verified.

        Raises:
            SeveralErrors: what hindered the verification, and what hinders this.
        """
        if not self.state.is_unverified:
            return
        step = Compute(kind="roll back")
        try:
            self._performer.guards.watch.clear()  # what still holds will trip anew
            self.tell(events.StepBegun(step=step))
            self.tell(await shielded(self._performer.perform(step, self.state)))
        except HexacellError as error:
            problem = "the new geometry was not verified, and could not be taken back"
            raise SeveralErrors(problem, [cause, error]) from cause

    def _end(self) -> events.Ended:
        ended = ending(self.state)
        if self.state.ended is None:
            self.tell(ended)
        return ended
