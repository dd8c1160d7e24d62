"""A plain terminal attached to a run in a process of its own: the same words and letters as ``run``."""

from __future__ import annotations

import asyncio
import sys
import termios
from collections.abc import Coroutine
from typing import Any

from hexacell.cli.console import Console
from hexacell.cli.run_status import RunStatus
from hexacell.cli.terminal import APPROVER, KeyboardCommands
from hexacell.errors import ExitCode, HexacellError
from hexacell.run_process.connection import RunConnection
from hexacell.run_process.messages import (
    ControlChanged,
    EventRecorded,
    HostFailed,
    HostMessage,
    QuestionClosed,
    QuestionOpened,
    RunDescribed,
    StatusChanged,
)
from hexacell.run_process.snapshots import LiveSnapshot
from hexacell.text.answers import request_text, typed_answer
from hexacell.text.events import EventFormatter
from hexacell.text.layout import wrapped
from hexacell.text.line_face import (
    DETACHABLE_LETTERS,
    attached_resume_hint,
    control_text,
    gauges_text,
    record_text,
)
from hexacell.text.run import question_text
from procedures.run import events
from procedures.run.commands import Answer, Command
from procedures.run.questions import Question
from procedures.run.state import RunState, apply

LEFT = "The run goes on. `hexacell attach CELL` comes back to it."


class AttachedTerminal:
    """Shows what a run tells, and sends it what is typed."""

    def __init__(self, console: Console, connection: RunConnection) -> None:
        self._console = console
        self._connection = connection
        self._formatter = EventFormatter()
        self._status = RunStatus(0)
        self._keys = self._new_keys()
        self._state = RunState()
        self._run: RunDescribed | None = None
        self._expected = 0
        self._question: Question | None = None
        self._snapshot: LiveSnapshot | None = None
        self._is_catching_up = True
        self._exit_code = ExitCode.INTERRUPTED
        self._sending: set[asyncio.Task[None]] = set()

    async def run(self) -> ExitCode:
        """Until the run is over, or it is left; how it ended."""
        self._console.print(DETACHABLE_LETTERS)
        loop = asyncio.get_running_loop()
        loop.add_reader(sys.stdin, self._read)
        try:
            async for message in self._connection.messages():
                self._show(message)
        finally:
            loop.remove_reader(sys.stdin)
        return self._exit_code

    def _show(self, message: HostMessage) -> None:
        match message:
            case RunDescribed():
                self._begin(message)
            case EventRecorded(event=event):
                self._show_event(event)
            case StatusChanged(status=status):
                self._status.status = status
                self._catch_up()
            case QuestionOpened(question=question):
                self._question = question
                # An Enter pressed too often, before this question, must not answer it.
                termios.tcflush(sys.stdin, termios.TCIFLUSH)
                self._console.prompt(question_text(question))
            case QuestionClosed():
                self._question = None
            case LiveSnapshot():
                self._snapshot = message
            case ControlChanged():
                self._console.print(control_text(message))
            case HostFailed():
                self._fail(message)

    def _begin(self, run: RunDescribed) -> None:
        self._run, self._expected = run, run.expected_records
        self._status, self._keys = RunStatus(run.expected_records), self._new_keys()
        self._formatter, self._state = EventFormatter(), RunState()
        self._is_catching_up = True

    def _show_event(self, event: events.Event) -> None:
        self._state = apply(self._state, event)
        self._status(event, self._state)
        self._keys(event, self._state)
        lines = self._formatter.lines(event, self._state)
        if isinstance(event, events.Ended):
            self._exit_code = ExitCode(event.exit_code)
            lines.append(event.line)
        if isinstance(event, events.RecordTaken):
            line = f"{self._state.completed} of {self._expected}: {record_text(event)}"
            lines.append(wrapped(line, indent=2))
        if not self._is_catching_up:
            for line in lines:
                self._console.print(line)

    def _catch_up(self) -> None:
        """What happened before is told in short."""
        if self._is_catching_up:
            self._is_catching_up = False
            self._console.print(self._status.text())

    def _fail(self, failure: HostFailed) -> None:
        if failure.exit_code is not None:
            self._exit_code = ExitCode(failure.exit_code)
        self._console.error(". ".join(filter(None, (failure.problem, failure.action))))
        if failure.exit_code is not None and self._run is not None and self._state.started is not None:
            self._console.print(attached_resume_hint(self._run))

    def _new_keys(self) -> KeyboardCommands:
        tell = {
            "g": self._tell_gauges,
            "s": lambda: self._console.print(self._status.text()),
            "t": lambda: self._send(self._connection.take_control()),
            "q": lambda: self._send(self._leave()),
        }
        return KeyboardCommands(self._console, self._give, sys.stdin, tell, DETACHABLE_LETTERS)

    def _read(self) -> None:
        line = sys.stdin.readline()
        if not line:  # the terminal is gone: the run pauses
            asyncio.get_running_loop().remove_reader(sys.stdin)
            return
        answer = None if self._question is None else typed_answer(line, self._question, APPROVER)
        if answer is not None:
            self._give(Answer(answer.value))
            return
        self._keys.take(line)
        if self._question is not None:
            self._console.prompt(request_text(self._question))

    def _tell_gauges(self) -> None:
        if self._snapshot is not None:
            self._console.print(gauges_text(self._snapshot))

    def _give(self, command: Command) -> None:
        self._send(self._connection.give(command))

    async def _leave(self) -> None:
        self._exit_code = ExitCode.DONE
        self._console.print(LEFT)
        await self._connection.leave(keep_running=True)

    def _send(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(self._sent(work))
        self._sending.add(task)
        task.add_done_callback(self._sending.discard)

    async def _sent(self, work: Coroutine[Any, Any, None]) -> None:
        try:
            await work
        except HexacellError as error:
            self._console.error(str(error))
