"""How people steer a running engine: commands with their queue, and answers to its questions."""

import asyncio
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from hexacell.errors import AnswerNeeded, UsageError
from procedures.run import questions
from procedures.run.cancellation import cancel_and_wait
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps import events

REASON = "a person asked for it"

Invalidation = events.RecordDiscarded | events.SetInvalidated


@dataclass(frozen=True, slots=True)
class Pause:
    """Pause after the record that is being taken; ``at_once`` stops motion in place instead."""

    at_once: bool = False


@dataclass(frozen=True, slots=True)
class Resume:
    """Continue after a pause: a step that was cancelled is decided again."""


@dataclass(frozen=True, slots=True)
class Undo:
    """Take the last record again, of the set being measured or else of all; a reference voids its set."""


@dataclass(frozen=True, slots=True)
class MeasureAgain:
    """Take one record of a set again at the same pose, or the whole set."""

    at: SetKey
    orientation: int | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to the open question (:class:`procedures.run.questions.Question`)."""

    value: str | None = None


@dataclass(frozen=True, slots=True)
class Stop:
    """End after the step that is being executed; the run can be resumed."""

    reason: str = "a stop was asked for"


@dataclass(frozen=True, slots=True)
class Abort:
    """Stop motion in place and end; the run can be resumed."""

    reason: str = "aborted"


@dataclass(frozen=True, slots=True)
class EndAtReference:
    """After the step that is being executed go back to the set's reference and end; it can be resumed."""

    reason: str


Command = Pause | Resume | Undo | MeasureAgain | Answer | Stop | Abort | EndAtReference


class CommandQueue:
    """Commands to one engine, in order; any thread or signal handler may put them in."""

    def __init__(self) -> None:
        self._commands: deque[Command] = deque()
        self._arrived = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self.is_over = False

    @property
    def is_attended(self) -> bool:
        """Whether an engine takes out what is put in."""
        return self._loop is not None

    def put(self, command: Command) -> None:
        """Add a command; returns at once."""
        self._commands.append(command)
        if self._loop is not None:
            with suppress(RuntimeError):  # the loop has just been closed
                self._loop.call_soon_threadsafe(self._arrived.set)

    async def next(self) -> Command:
        """The oldest command, as soon as there is one."""
        while not self._commands:
            self._arrived.clear()
            await self._arrived.wait()
        return self._commands.popleft()

    def take(self) -> Iterator[Command]:
        """All that are there, oldest first."""
        while self._commands:
            yield self._commands.popleft()

    @contextmanager
    def attended(self) -> Iterator[None]:
        """Within this context the running loop takes the commands; afterwards the run is over."""
        self._loop = asyncio.get_running_loop()
        try:
            yield
        finally:
            self._loop, self.is_over = None, True


def invalidation_event(command: Undo | MeasureAgain, state: RunState) -> Invalidation:
    """The event of a command; raises ``UsageError`` where no such record is, or a result depends on it."""
    if isinstance(command, Undo):
        begun = [
            key for key, one in state.sets.items() if one.samples
        ]  # the last, where the robot has left it
        measured = [key for key in state.open_sets if key in begun] or begun
        if not measured:
            raise UsageError("there is no record to undo yet")
        key = state.at_pose[0] if state.at_pose and state.at_pose[0] in measured else measured[-1]
        orientation: int | None = state.sets[key].samples[-1].orientation
    else:
        key, orientation = command.at, command.orientation
    samples = state.set(key).samples
    if not samples or (orientation is not None and orientation not in {s.orientation for s in samples}):
        raise UsageError(f"{key} has no such record")
    if dependent := _dependent_result(key.phase, state):
        raise UsageError(f"{key} cannot be measured again: {dependent}", action="Begin a new run")
    if orientation is None or orientation == 1:
        return events.SetInvalidated(at=key, reason=REASON)
    return events.RecordDiscarded(at=key, orientation=orientation)


def _dependent_result(phase: Phase, state: RunState) -> str | None:
    match phase:
        case Phase.IDENTIFY if state.identified:
            return "the geometry was identified from it"
        case Phase.BEFORE if state.committed:
            return "the controller has another geometry by now"
        case _ if state.judged:
            return "the result was judged by it"
        case _:
            return None


class QuestionBroker:
    """Passes questions on to an operator; the first answer counts, its own or one given to :meth:`answer`.

    ``open`` is the question that waits for an answer, if one does; ``watchers`` are called with every
    question that is opened, and with None when it is closed.
    """

    def __init__(self, operator: questions.Operator) -> None:
        self._operator = operator
        self._answer: asyncio.Future[str | None] | None = None
        self.open: questions.Question | None = None
        self.watchers: list[Callable[[questions.Question | None], None]] = []

    def answer(self, answer: str | None) -> bool:
        """Answer the open question; False if none is open or this is no answer to it."""
        if self.open is None or self._answer is None or self._answer.done():
            return False
        answer = self.open.default if answer is None else answer
        if self.open.choices and answer not in self.open.choices:
            return False
        self._answer.set_result(answer)
        return True

    async def ask(self, question: questions.Question) -> str | None:
        """The operator's answer, or one given meanwhile; raises ``AnswerNeeded`` if there is none."""
        asked = asyncio.ensure_future(self._operator.ask(question))
        self._answer = asyncio.get_running_loop().create_future()
        self._set_open(question)
        try:
            await asyncio.wait([asked, self._answer], return_when=asyncio.FIRST_COMPLETED)
            return self._answer.result() if self._answer.done() else asked.result()
        finally:
            self._answer.cancel()
            self._set_open(None)
            await cancel_and_wait(asked)

    def _set_open(self, question: questions.Question | None) -> None:
        self.open = question
        for watcher in self.watchers:
            watcher(question)


class UnattendedOperator:
    """No person is present: every question ends the run."""

    async def ask(self, question: questions.Question) -> str | None:
        """Raise ``AnswerNeeded``: what is needed, and how to run without it where that is possible."""
        match question.subject:
            case questions.GaugePlacement(pose=pose, seat=int(seat)):
                raise AnswerNeeded(
                    f"the gauges must be mounted in seat {seat} of the fixture ({pose}), but the run is "
                    "unattended",
                    action='Run it attended, or set mounting = "fixed" in [length_check] if no person is '
                    "needed",
                )
            case questions.GaugePlacement(station=station, pose=pose):
                raise AnswerNeeded(
                    f"the gauges must be put around the ball at {station} ({pose}), but the run is "
                    "unattended",
                    action='Run it attended, or use fixed stations (placement = "fixed" in [stations])',
                )
            case questions.PendingChange(gates=gates):
                reasons = " ".join(gate.sentence for gate in gates if not gate.passed)
                raise AnswerNeeded(
                    f"the new geometry waits for approval: {reasons or 'the cell file says to ask'}"
                )
            case questions.WrittenResult(line=line):
                raise AnswerNeeded(f"{line}: a person must decide whether the new geometry stays")
            case questions.UnreadyController(problem=problem, word=None):
                raise AnswerNeeded(
                    f"{problem}, and the run is unattended",
                    action="Find out why, release it and reset it at the controller, then begin or resume",
                )
            case questions.UnreadyController(problem=problem, word=word):
                raise AnswerNeeded(
                    f"{problem}, and the run is unattended",
                    action=f'Add "{word}" to startup in [controller] if the program may do that by itself, '
                    "do it at the controller, or run it attended",
                )
            case questions.StepFailure(problem=problem):
                raise AnswerNeeded(f"{problem} A person must choose: {', '.join(question.choices)}")
