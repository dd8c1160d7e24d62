"""A run as an object: in a process of its own, which goes on while a notebook computes or is closed."""

from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable, Coroutine, Generator
from contextlib import aclosing, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from time import monotonic
from typing import Any, Self

from hexacell.api.follower import Follower
from hexacell.api.result import Result, read_result
from hexacell.cell.loader import Cell
from hexacell.errors import AnswerNeeded, FileError, HexacellError, UsageError
from hexacell.measurements.records import MeasurementSet
from hexacell.run_process import client
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.run_process.messages import EventRecorded, HostFailed, HostMessage
from hexacell.run_process.run_socket import socket_path
from hexacell.services.history.resumption import LATEST
from hexacell.text.line_face import EventFormatter
from hexacell.text.screens.questions import question_view
from hexacell.text.screens.run_picture import RunPicture, picture_after
from procedures.calibration.calibration import Mode
from procedures.engine.commands import Abort, Answer, Command, Pause, Resume
from procedures.run.questions import Question
from procedures.steps.events import Ended, Event

GIVEN_WITHIN_S = 10.0
"""A command that the run's process has not taken by then is lost, s."""


@dataclass(frozen=True, slots=True)
class RunEvent:
    """What happened in a run, or a question that waits for an answer.

    Attributes:
        at: when, UTC.
        text: what a person is told; empty where that is nothing.
        event: as the journal has it; None for a question.
        question: to be answered; None for an event.
    """

    at: datetime
    text: str
    event: Event | None = None
    question: Question | None = None

    @property
    def kind(self) -> str:
        """``sampled``, ``identified``, ``paused``, ... as in the journal, or ``question``."""
        return "question" if self.event is None else self.event.kind


class Run:
    """A run that goes on, from :func:`start_run`, :func:`resume_run` or :func:`attach_to_run`.

    It is an iterator of what happens from its beginning on, blocking (``for``) or not (``async for``), and
    gives each event once. Commands return at once; what they cause is an event. ``await run`` is
    ``run.result()`` without blocking. At the end of a context (``with``) it is aborted if it is not over;
    where the program ends without that, it pauses after the record in progress.

    Attributes:
        folder: its run folder.
        status: ``running``, ``paused``, ``awaiting operator``, ``ended``, ...
        question: the one that waits for an answer, if any.
        live: what the devices showed last; None before that.

    Raises:
        HexacellError: it was refused or ended early; from whatever waits.
    """

    def __init__(self, connect: Callable[[], Awaitable[client.HostConnection]]) -> None:
        self.folder, self.status = Path(), ""
        self.question: Question | None = None
        self.live: LiveSnapshot | None = None
        self._connect = connect
        self._picture, self._formatter = RunPicture(), EventFormatter()
        self._told: deque[RunEvent] = deque()
        self._follower = Follower(self._messages, self._take, "the events of the run")
        self._follower.wait(lambda: self._picture.described)

    @property
    def records(self) -> MeasurementSet:
        """The records for the identification so far."""
        return self._picture.state.measurements()

    def pause(self, *, at_once: bool = False) -> None:
        """Pause after the record that is being taken, or stop motion in place."""
        self._give(Pause(at_once))

    def resume(self, *, moves_robot: bool = False) -> None:
        """Go on after a pause; raises ``UsageError`` without a person's word that the robot may move."""
        _require_permission(moves_robot)
        self._give(Resume())

    def abort(self) -> None:
        """Stop motion in place and end; the run can be resumed."""
        self._give(Abort("a person aborted it"))

    def answer(self, value: str | None, *, consent: str = "yes") -> None:
        """Answer the open question: one of its choices, or the name of who approves; None declines.

        ``consent`` is what the question asks for: the name of the cell where a change is unusual. Raises
        ``UsageError`` where no question is open, or this is no answer to it.
        """
        if (question := self.question) is None:
            raise UsageError("no question is open", action="Wait for one: it is among the run's events")
        if question.choices and value not in question.choices:
            action = f"Answer one of: {', '.join(question.choices)}"
            raise UsageError(f"{value!r} is no answer to this question", action=action)
        if not question.choices and value is not None and consent != question.consent:
            action = f"Read its text; then say consent={question.consent!r}"
            raise UsageError("this change is unusual, and needs more than a name", action=action)
        self._give(Answer(value))
        self._follower.wait(lambda: self._follower.is_over or self.question is not question or None)

    def take_control(self) -> None:
        """Give the commands from now on; who did so before, as at a screen, watches."""
        self._send(lambda connection: connection.take_control())
        self._follower.wait(lambda: self._follower.is_over or self._picture.may_command or None)

    def leave(self, *, keep_running: bool) -> None:
        """Let it go on without anybody, or have it stopped in place."""
        with suppress(HexacellError):  # it ended meanwhile
            self._send(lambda connection: connection.leave(keep_running=keep_running))
        self._follower.stop()

    def result(self) -> Result:
        """Wait for its end; raises ``AnswerNeeded`` while a question is open, to be called again then."""
        return read_result(self._follower.wait(self._ended))

    def __await__(self) -> Generator[Any, None, Result]:
        return self._awaited().__await__()

    async def _awaited(self) -> Result:
        return read_result(await self._follower.awaited(self._ended))

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> RunEvent:
        if not (found := self._follower.wait(self._next)):
            raise StopIteration
        return found[0]

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> RunEvent:
        if not (found := await self._follower.awaited(self._next)):
            raise StopAsyncIteration
        return found[0]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.leave(keep_running=False)

    def _repr_html_(self) -> str:
        asked = "" if self.question is None else f"<pre>{escape(_asked(self.question, self.live))}</pre>"
        return f"<b>{escape(self.folder.name)}: {self.status}</b>, {len(self.records)} records{asked}"

    async def _messages(self) -> AsyncGenerator[HostMessage, None]:
        self._connection = await self._connect()
        failure: HostFailed | None = None
        async with aclosing(self._connection.messages()) as messages:
            async for message in messages:
                if isinstance(message, HostFailed) and message.exit_code is not None:
                    failure = message
                yield message
        if failure is not None:
            raise client.RunFailed(failure)

    def _take(self, message: HostMessage) -> None:
        self._picture = picture = picture_after(self._picture, message, monotonic())
        if picture.described is not None:
            self.folder = picture.described.folder
        if isinstance(message, EventRecorded):
            text = self._formatter.story(message.event, picture.state)
            self._told.append(RunEvent(message.at, text, message.event))
        if picture.question not in {None, self.question}:
            text = _asked(picture.question, picture.live)
            self._told.append(RunEvent(datetime.now(UTC), text, question=picture.question))
        self.status, self.question, self.live = picture.status.value, picture.question, picture.live

    def _next(self) -> tuple[RunEvent, ...] | None:
        """The next event; nothing at a good end, and None where it has not happened yet."""
        while self._told:
            event = self._told.popleft()
            if event.question in {None, self.question}:  # another has been answered
                return (event,)
        return () if self._follower.is_over and self._follower.failure is None else None

    def _ended(self) -> Path | None:
        """The folder of the run, when it is over."""
        if self.question is not None and not self._follower.is_over:
            action = "Give it with answer(); then wait again"
            problem = f"the run waits for an answer: {_asked(self.question, self.live)}"
            raise AnswerNeeded(problem, action=action)
        return self.folder if self._follower.is_over and isinstance(self._picture.last, Ended) else None

    def _give(self, command: Command) -> None:
        if not self._picture.may_command:
            who = self._picture.control and self._picture.control.who
            raise UsageError(f"{who or 'nobody'} is in control of this run", action="Call take_control()")
        self._send(lambda connection: connection.give(command))

    def _send(self, message: Callable[[client.HostConnection], Coroutine[Any, Any, None]]) -> None:
        if self._follower.is_over:
            raise self._follower.failure or UsageError("this run is over", action="Read its result()")
        try:
            self._follower.call(message(self._connection), GIVEN_WITHIN_S)
        except TimeoutError as error:
            action = "Look at the robot; `hexacell history` says what happened"
            raise FileError("the run cannot be reached any more", action=action) from error


def _asked(question: Question | None, live: LiveSnapshot | None) -> str:
    """What a question asks, and what may be answered."""
    if question is None:
        return ""
    view = question_view(question, live)
    takes = " or ".join(question.choices) or "the name of who approves it, or None"
    return "\n".join([view.title, *view.paragraphs, f"Answer: {takes}"])


def start_run(
    cell: Cell, mode: str = "optimise", *, moves_robot: bool = False, length_check: bool = False
) -> Run:
    """Begin a run of a cell; its robot, real or simulated, moves.

    Args:
        cell: of which no run goes on.
        mode: ``optimise`` calibrates; ``check``, ``quick`` and ``length`` as in ``hexacell run --mode``.
        moves_robot: True is a person's word that the robot may move.
        length_check: whether a calibration checks the scale of the encoders too.

    Raises:
        UsageError: nobody has said that the robot may move, or there is no such mode.
        HexacellError: the run is refused, with every reason.
    """
    _require_permission(moves_robot)
    if mode not in (known := [one.value for one in Mode]):
        raise UsageError(f"there is no mode '{mode}'", action=f"There are: {', '.join(known)}")
    return Run(lambda: client.begin_run(cell, Mode(mode), length_check=length_check))


def resume_run(cell: Cell, run: str | Path = LATEST, *, moves_robot: bool = False) -> Run:
    """Resume an interrupted run, by name or folder, by default the latest; raises as :func:`start_run`."""
    _require_permission(moves_robot)
    return Run(lambda: client.resume_run(cell, str(run)))


def attach_to_run(cell: Cell) -> Run:
    """The run of a cell that goes on, begun here, at a screen or elsewhere, told from its beginning.

    Raises:
        UsageError: none goes on.
    """

    async def connect() -> client.HostConnection:
        if (found := await client.connect_to_run(socket_path(cell))) is None:
            raise UsageError(f"no run of {cell.settings.name} goes on", action="Begin one with start_run")
        return found

    return Run(connect)


def _require_permission(moves_robot: bool) -> None:
    if moves_robot is not True:
        action = "See that its way is free and nobody is within its reach; then say moves_robot=True"
        raise UsageError("this moves the robot, and nobody has said that it may", action=action)
