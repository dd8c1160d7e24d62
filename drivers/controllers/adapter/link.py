"""One connection to a program that speaks the adapter protocol: started by us, or a TCP server."""

import asyncio
import logging
from asyncio.subprocess import PIPE, Process
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, TypeVar

from drivers import errors
from drivers.controllers.adapter import messages
from drivers.controllers.adapter.options import Program
from drivers.wire_trace import LineRecord, TraceRecorder, TrafficDirection
from hexacell.errors import DeviceError
from hexacell.printable import printable

_log = logging.getLogger("drivers.controllers.adapter")

SHOWN_LINES = 4
"""Last lines that a program printed on stderr, in the message that it ended."""

SHOWN_SIGNS = 200
AnswerType = TypeVar("AnswerType", bound=messages.Answer)
ACTION = "See what the controller does, then prepare it again"


class RequestFailed(Exception):
    """The program says that a request failed."""

    def __init__(self, failure: messages.Failure) -> None:
        self.failure = failure
        super().__init__(failure.reason)


class Link:
    """Asks, and finds the answers by their numbers; after anything unexpected it is broken for good."""

    def __init__(self, program: Program, trace: TraceRecorder | None) -> None:
        self._program = program
        self._record = LineRecord(program.name, trace)
        self._pending: dict[int, asyncio.Future[Mapping[str, Any]]] = {}
        self._count = 0
        self._process: Process | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._printed: deque[str] = deque(maxlen=SHOWN_LINES)
        self.broken: DeviceError | None = None

    async def open(self, limit_s: float) -> None:
        """Start the program, or connect to it.

        Raises:
            ConnectionLost: it cannot be started, or nobody answers at its address.
        """
        program = self._program
        try:
            if program.command:
                # In a session of its own: Ctrl-C must not end it before it has stopped the robot.
                self._process = await asyncio.create_subprocess_exec(
                    *program.command,
                    stdin=PIPE,
                    stdout=PIPE,
                    stderr=PIPE,
                    limit=messages.LONGEST_LINE,
                    start_new_session=True,
                )
                reader, self._writer = self._process.stdout, self._process.stdin
                if self._process.stderr is not None:
                    self._tasks.append(asyncio.create_task(self._read_printed(self._process.stderr)))
            else:
                async with asyncio.timeout(limit_s):
                    connecting = asyncio.open_connection(*program.address, limit=messages.LONGEST_LINE)
                    reader, self._writer = await connecting
        except (OSError, TimeoutError) as error:
            reason = getattr(error, "strerror", None) or str(error) or "nobody answers"
            what = f"cannot be started: {program.command[0]}" if program.command else "cannot be reached"
            raise errors.ConnectionLost(
                f"{what}: {reason}",
                subject=program.name,
                action="Check [controller.options] in the cell file",
            ) from error
        assert reader is not None  # noqa: S101 - as PIPE says
        self._tasks.append(asyncio.create_task(self._read(reader)))

    async def request(
        self,
        do: str,
        wanted: type[AnswerType],
        limit_s: float,
        **fields: Any,  # noqa: ANN401 - of the protocol
    ) -> AnswerType:
        """What the program answers to a request.

        Raises:
            RequestFailed: that it failed.
            ResponseTimeout: nothing, in time.
            ConnectionLost: nothing, and it is gone.
            WrongAnswer: nothing of the protocol.
        """
        self._count += 1
        number, answered = self._count, asyncio.get_running_loop().create_future()
        self._pending[number] = answered
        try:
            async with asyncio.timeout(limit_s):
                await self._send(number, do, fields)
                done = await answered
        except TimeoutError:
            late = errors.ResponseTimeout(
                f"has not answered '{do}' after {limit_s:g} s", subject=self._program.name, action=ACTION
            )
            self._break(late)
            raise late from None
        try:
            return messages.checked(wanted, done)
        except messages.UnknownAnswer as error:
            raise self._break(
                self._wrong(f"answers '{do}' with what does not belong there: {error}")
            ) from error

    async def close(self, limit_s: float) -> None:
        """End the connection, so that the program stops the robot; one that does not end is killed."""
        self._break(errors.ConnectionLost("is closed", subject=self._program.name))
        if self._process is not None:
            try:
                async with asyncio.timeout(limit_s):
                    await self._process.wait()
            except TimeoutError:
                _log.warning("%s does not end, and is killed", self._program.name)
                with suppress(ProcessLookupError):
                    self._process.kill()
                await self._process.wait()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _send(self, number: int, do: str, fields: Mapping[str, Any]) -> None:
        if self.broken is not None or self._writer is None:
            raise self.broken or errors.ConnectionLost("is not open", subject=self._program.name)
        self._record.add(TrafficDirection.SENT, messages.request_line(number, do, fields, is_shown=True))
        try:
            self._writer.write(messages.request_line(number, do, fields))
            await self._writer.drain()
        except OSError as error:
            raise self._break(await self._lost()) from error

    async def _read(self, reader: asyncio.StreamReader) -> None:
        """Take each line until the first that is unexpected."""
        try:
            while line := await reader.readline():
                self._record.add(TrafficDirection.RECEIVED, line)
                if not line.endswith(b"\n"):
                    break  # it ended within a message
                self._take(line)
        except messages.UnknownAnswer as error:
            shown = printable(line[:SHOWN_SIGNS].decode("utf-8", "replace")).strip()
            self._break(self._wrong(f"sent what does not belong to the protocol: {shown} ({error})"))
        except ValueError:  # a line beyond the reader's limit
            self._break(self._wrong(f"sent more than {messages.LONGEST_LINE} bytes without a line end"))
        except OSError:
            self._break(await self._lost())
        else:
            self._break(await self._lost())

    def _take(self, line: bytes) -> None:
        message = messages.read_line(line)
        answered = self._pending.get(message.id)
        if answered is None:
            raise messages.UnknownAnswer("no request of this number waits")
        if message.at is not None:
            return
        del self._pending[message.id]
        if answered.done():  # whoever asked has gone
            return
        if message.failed is not None:
            answered.set_exception(RequestFailed(message.failed))
        elif message.done is not None:
            answered.set_result(message.done)

    async def _read_printed(self, reader: asyncio.StreamReader) -> None:
        with suppress(OSError, ValueError):
            while line := await reader.readline():
                text = printable(line[:SHOWN_SIGNS].decode("utf-8", "replace").strip())
                self._printed.append(text)
                _log.info("%s printed: %s", self._program.name, text)

    async def _lost(self) -> DeviceError:
        """The program has ended, or its connection: what is known of it."""
        if self._process is None:
            problem = "has closed the connection"
        else:
            with suppress(TimeoutError):
                async with asyncio.timeout(1.0):
                    await self._process.wait()
            code = self._process.returncode
            problem = "closed its output" if code is None else f"ended with code {code}"
        said = f": {' / '.join(self._printed)}" if self._printed else ""
        return errors.ConnectionLost(f"{problem}{said}", subject=self._program.name, action=ACTION)

    def _wrong(self, problem: str) -> DeviceError:
        return errors.WrongAnswer(problem, subject=self._program.name, action="Correct the program")

    def _break(self, error: DeviceError) -> DeviceError:
        """Trust it no more: whoever waits gets the error, and the program sees the end and stops the robot."""
        self.broken = self.broken or error
        for answered in self._pending.values():
            if not answered.done():
                answered.set_exception(error)
                answered.exception()  # nobody may wait for it any more
        self._pending.clear()
        if self._writer is not None:
            self._writer.close()
        return error
