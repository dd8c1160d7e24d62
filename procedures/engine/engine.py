"""The engine of a run: decide on a step, journal it, execute it, journal its event; until none is left."""

import asyncio
from collections.abc import Callable, Sequence

from hexacell.cell.recovery import Escalations
from hexacell.errors import ExitCode, HexacellError, Interruption, OutOfTime, SeveralErrors
from hexacell.verdict.decision import Verdict
from procedures.engine.command_loop import CommandLoop, Status, StepCancelled
from procedures.engine.commands import Command, CommandQueue, QuestionBroker, UnattendedOperator
from procedures.engine.recovery import GIVE_UP, Recovery, Reversal, revert_at_end, revert_unrecorded
from procedures.journal.journal import EvidenceLost, Journal, is_evidence_lost
from procedures.run.cancellation import shielded
from procedures.run.keys import Phase
from procedures.run.state import RunState, apply, fold
from procedures.run.trips import GuardTripped, RobotNotStopped, may_still_move
from procedures.steps import events
from procedures.steps.events import Step
from procedures.workflow.next_step import StepExecutor

Listener = Callable[[events.Event, RunState], None]

_KILLED = int(ExitCode.INTERRUPTED)
_BEFORE_SAMPLING = (events.Located, events.Arrived, events.GaugesPlaced)
"""After these a record is still being taken; a pause waits for it."""

WHOLE_SETS = frozenset({Phase.BEFORE, Phase.LENGTH})
"""Phases whose poses must all be measured: a set with a rejected record is measured again."""


class Engine:
    """One run, from the end of its journal to the end of the run.

    A user interface receives events through listeners, called after each event is on the disk, and the
    status as a watcher of ``commands``. It controls the run by what it puts, from any thread, into
    ``queue``. The executor's operator should be ``broker``, so that any user interface may watch and answer
    the question that is open.
    """

    def __init__(
        self,
        executor: StepExecutor,
        journal: Journal,
        listeners: Sequence[Listener] = (),
        *,
        queue: CommandQueue | None = None,
        broker: QuestionBroker | None = None,
        policy: Escalations = GIVE_UP,
    ) -> None:
        self._executor = executor
        self._journal = journal
        self._listeners = tuple(listeners)
        self.queue = queue or CommandQueue()
        self.broker = broker or QuestionBroker(UnattendedOperator())
        self.commands = CommandLoop(self.queue, self.broker, state=lambda: self.state, reject=self._reject)
        self._recovery = Recovery(
            executor, self.commands, self.broker, policy, halt=self._halt, record=self.record
        )
        self._is_prepared = False
        self._last: events.Event | None = None
        self._trip: events.Tripped | None = None
        self.state = fold(journal.events)

    @property
    def status(self) -> Status:
        """What the engine is doing now."""
        return self.commands.flags.status

    async def run(self) -> events.Ended:
        """Execute all steps that are left.

        On any error the robot is stopped in place, a change of the config that may not stay is reverted
        (:func:`revert_at_end`), and the journal gets an ``Interrupted``.

        Raises:
            Interruption: a command ended the run early.
            EvidenceLost: its journal is no longer what it wrote.
            OutOfTime: it was to end, and the robot is back at a reference.
            WriteBackUndone: a written geometry could not be verified; the config is as before.
            RobotNotStopped: it ended early, and the robot could not be stopped.
            HexacellError: a step failed, and the policy ends the run.
        """
        self.commands.set_flags(begun=True)
        try:
            with self.queue.attended():
                while await self._advance():
                    pass
        except BaseException as error:
            raised = await self._unwind(error)
            if raised is error:
                raise
            raise raised from error
        finally:
            self.commands.set_flags(ended=True)
        ended = _ending(self.state)
        if self.state.ended is None:
            self.record(ended)
        return ended

    def reopen_sets(self) -> None:
        """Continue after an interruption: discard the sets that cannot be continued.

        The journal of a run that was killed gets an ``Interrupted``: the robot's position is unknown.
        """
        is_moving = self.state.target is not None and not self.state.position_unknown
        if is_moving or self.state.recalled is not None:
            self.record(events.Interrupted(reason="the program ended unexpectedly", exit_code=_KILLED))
        for key in self.state.open_sets:
            measured = self.state.set(key)
            if not measured.samples or (measured.rejections and key.phase in WHOLE_SETS):
                self.record(events.SetInvalidated(at=key, reason="the run was interrupted in this set"))

    def record(self, event: events.Event) -> RunState:
        """Journal an event, then call the listeners; gives the state after it. Raises ``FileError``."""
        self._journal.append(event)
        self.state = apply(self.state, event)
        self._last = event
        if isinstance(event, events.Tripped | events.StepBegun):  # of the step that is being executed
            self._trip = event if isinstance(event, events.Tripped) else None
        for listener in self._listeners:
            listener(event, self.state)
        return self.state

    async def _halt(self) -> HexacellError | None:
        """Stop motion in place; why it is not certain that the robot has stopped, if it is not."""
        self._is_prepared = False
        try:
            await shielded(self._executor.devices.controller.stop())
        except HexacellError as error:
            return error
        return None

    async def _advance(self) -> bool:
        """Obey the commands that waited, decide on a step and execute it; False if none is left."""
        self.commands.catch_up()
        self._obey_requests()
        flags = self.commands.flags
        if flags.pausing and (flags.at_once or not isinstance(self._last, _BEFORE_SAMPLING)):
            await self._pause(at_once=flags.at_once)
        step: Step | None = None
        try:
            if not self._is_prepared:
                await self.commands.run_cancellable(self._executor.prepare(self.state))
                self._is_prepared = True
            step = await self.commands.run_cancellable(self._decide())
            if step is None:
                return False
            self.record(events.StepBegun(step=step))
            executing = self._executor.perform(step, self.state)
            await self._record_outcome(await self.commands.run_cancellable(executing))
        except StepCancelled:
            pass
        except (OutOfTime, EvidenceLost):
            raise
        except HexacellError as error:
            await self._recovery.recover(error, step, self.state)
        return True

    async def _decide(self) -> Step | None:
        """The next step; raises ``OutOfTime`` where the run was recalled and the robot is back."""
        step = await asyncio.to_thread(self._executor.next_step, self.state)
        if step is None and (reason := self.state.recalled) is not None:
            raise OutOfTime(f"the run was ended: {reason}", action="Resume it; what was measured is kept")
        return step

    async def _record_outcome(self, event: events.Event) -> None:
        """Journal what a step caused; a change of the config that cannot be journalled is reverted."""
        try:
            self.record(event)
        except HexacellError as error:
            reversal = revert_unrecorded(event, self.state)
            raised = error if reversal is None else await self._revert(reversal, error)
            if raised is error:
                raise
            raise raised from error

    async def _unwind(self, error: BaseException) -> BaseException:
        """End a run early; gives the error to raise.

        The robot is stopped first, whatever happened. Then a change of the config that may not stay is
        reverted. The journal gets an ``Interrupted`` last, as far as it can be written.
        """
        raised = error
        try:
            stop_failure = await self._halt()
            if isinstance(error, GuardTripped) and self._trip != (trip := events.Tripped.of(error.trip)):
                self._record_if_possible(trip)
            if reversal := revert_at_end(self.state, error):
                raised = await self._revert(reversal, error)
            if stop_failure and isinstance(raised, HexacellError) and not may_still_move(raised):
                raised = RobotNotStopped(stop_failure, raised)
        finally:
            code = ExitCode.FAULT if isinstance(raised, Exception) else ExitCode.INTERRUPTED
            code = raised.exit_code if isinstance(raised, HexacellError) else code
            reason = str(raised) or type(raised).__name__
            lost = self._record_if_possible(events.Interrupted(reason=reason, exit_code=int(code)))
        if lost is None or not isinstance(raised, HexacellError) or is_evidence_lost(error):
            return raised
        return raised if may_still_move(raised) else SeveralErrors("the run ended early", [raised, lost])

    async def _revert(self, reversal: Reversal, cause: BaseException) -> BaseException:
        """Revert a change of the config, whatever is cancelled meanwhile; gives the error to report."""
        self._executor.guards.supervisor.clear()  # a guard whose reason persists trips again
        try:
            if reversal.is_recorded:
                self.record(events.StepBegun(step=reversal.step))
            event = await shielded(self._executor.perform(reversal.step, self.state))
            if reversal.is_recorded:
                self.record(event)
        except HexacellError as error:
            return reversal.failed(cause, error)
        return reversal.undone(cause)

    def _record_if_possible(self, event: events.Event) -> EvidenceLost | None:
        """Record an event; that the journal is lost, if it is."""
        try:
            self.record(event)
        except EvidenceLost as lost:
            return lost
        except HexacellError:
            pass
        return None

    async def _pause(self, *, at_once: bool) -> None:
        if at_once:
            self._is_prepared = False
            await shielded(self._executor.devices.controller.stop())
        self.record(events.Paused(at_once=at_once))
        self.commands.set_flags(pausing=False, at_once=False, paused=True)
        while self.commands.flags.paused:
            await self.commands.take_one()
            self._obey_requests()
        self.record(events.Resumed())

    def _obey_requests(self) -> None:
        """Record what was made invalid; raises ``Interruption`` if the run is to end."""
        for event in self.commands.take_invalidations():
            if self.state.set(event.at).samples:
                self.record(event)
        flags = self.commands.flags
        if flags.stopping:
            raise Interruption(flags.stopping)
        if flags.returning and self.state.recalled is None:
            self.record(events.RunRecalled(reason=flags.returning))

    def _reject(self, command: Command, reason: str) -> None:
        self.record(events.CommandRejected(command=type(command).__name__, reason=reason))


def _ending(state: RunState) -> events.Ended:
    """The last event of a run with nothing left to do."""
    if state.ended is not None:
        return state.ended
    line = state.judged.line if state.judged is not None else "nothing was judged"
    if state.accepted is not None and state.accepted.by is not None:
        line += f"; kept by {state.accepted.by}"
    if state.rolled_back:
        line += f"; rolled back, the controller has its old config{_comparison(state)}"
    kept = state.proposed if state.committed is not None and not state.rolled_back else None
    displacement = kept.displacement if kept is not None else None
    return events.Ended(exit_code=int(_final_code(state)), line=line, displacement=displacement)


def _comparison(state: RunState) -> str:
    """That the old config is the worse one, where that was measured."""
    verification = state.judged and state.judged.verification
    if not verification or verification.before_mm is None or verification.after_mm is None:
        return ""
    return ", the worse one" if verification.after_mm < verification.before_mm else ""


def _final_code(state: RunState) -> ExitCode:
    """The code of a run that is over."""
    if state.judged is None:
        return ExitCode.OUT_OF_LIMITS
    if state.judged.verdict is Verdict.PASS:
        return ExitCode.DONE
    if state.judged.verdict.is_conditional and state.accepted is not None:
        if state.accepted.by is not None:
            return ExitCode.DONE
        if not state.accepted.asked:
            return ExitCode.ANSWER_NEEDED
    return ExitCode.OUT_OF_LIMITS
