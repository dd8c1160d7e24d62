"""One connection to linuxcncrsh: greeting, then one command and one response at a time."""

import asyncio
import errno
import logging
import os
import re
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, ExitStack, asynccontextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from typing import Self, TypeVar

from drivers.controllers.linuxcnc import protocol
from drivers.errors import ConnectionLost, ResponseTimeout
from drivers.wire_trace import LineRecord, TraceRecorder, TrafficDirection
from hexacell.cell.robot import ControllerSettings
from hexacell.clock import Patience
from hexacell.errors import DeviceError
from hexacell.storage.atomic_files import SHORTAGES

ErrorT = TypeVar("ErrorT", bound=DeviceError)

_log = logging.getLogger("drivers.controllers.linuxcnc")

_CLIENT = "hexacell 1.0"
_CHUNK = 4096
_SHOWN = 80
_SLICE_S = 0.05
PARSED_S = 0.02
"""Within this time, s, LinuxCNC has read a command that was sent."""


class SendArbiter:
    """Which of our connections may send a command now, by two locks: the line, and a stop in progress.

    LinuxCNC 2.9 reads the commands of all clients with one ``strtok()``: two commands that arrive at the
    same moment garble each other. A query is answered within a millisecond. A command may take as long as
    a move, but ``PARSED_S`` after it was sent the server has read it, and another connection may send.

    =================  ==============================  =========================================
    connection         sends within                    waits for
    =================  ==============================  =========================================
    for commands       ``command_turn``                the end of a stop, then the line
    for status         ``query_turn``                  the line
    opening either     ``line``                        the line, which it keeps until greeted
    for a stop         ``stop``                        nothing, except another stop
    =================  ==============================  =========================================
    """

    def __init__(self) -> None:
        self.line = asyncio.Lock()
        self.stop = asyncio.Lock()

    @asynccontextmanager
    async def query_turn(self) -> AsyncIterator[None]:
        """Send inside; the line is released after ``PARSED_S`` even if the answer is still awaited."""
        await self.line.acquire()
        with ExitStack() as turn:
            turn.callback(self.line.release)
            turn.callback(asyncio.get_running_loop().call_later(PARSED_S, turn.close).cancel)
            yield

    @asynccontextmanager
    async def command_turn(self) -> AsyncIterator[None]:
        """Send inside, as in ``query_turn``, but not before a stop in progress has ended."""
        await self.stop_ended()
        async with self.query_turn():
            yield

    async def stop_ended(self) -> None:
        """Wait until no stop is in progress."""
        async with self.stop:
            pass


@dataclass(eq=False)
class Connection:
    """A connected and greeted client.

    The caller sends one command at a time. When its wait is cancelled or times out, the response is
    outstanding: ``collect_late_response`` receives it before the next command, so that it is never
    taken for the response to another one.

    Attributes:
        settings: of the server: its address, its passwords, its units.
        subject: of error messages.
        server: name and version of the server.
        send_turn: entered to send a command; see :class:`SendArbiter`. Unrestricted at first.
    """

    settings: ControllerSettings
    timeouts: protocol.Timeouts
    recorder: TraceRecorder | None
    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter
    server: str = ""
    send_turn: Callable[[], AbstractAsyncContextManager[None]] = nullcontext
    _buffer: protocol.LineBuffer = field(default_factory=protocol.LineBuffer)
    _lines: deque[str] = field(default_factory=deque)
    _outstanding: str | None = None

    def __post_init__(self) -> None:
        self.subject = protocol.subject_of(self.settings)
        self._wire = LineRecord(self.subject, self.recorder)

    @classmethod
    async def open(
        cls,
        settings: ControllerSettings,
        timeouts: protocol.Timeouts,
        recorder: TraceRecorder | None = None,
        *,
        commanding: bool = True,
    ) -> Self:
        """Connect, greet, switch echo off and verbose on and, if ``commanding``, take control.

        Raises:
            ConnectionLost: Nothing listens there, or it does not respond.
            DeviceError: Something else listens there, or a password is wrong.
        """
        connection = cls(settings, timeouts, recorder, *await _connect(settings, timeouts))
        try:
            await connection._greet()
            if commanding:
                await connection.take_control()
        except BaseException as error:
            _log.warning("%s: no connection: %s", connection.subject, error)
            await connection.close()
            raise
        _log.info("%s: connected to %s", connection.subject, connection.server)
        return connection

    async def request(self, command: str, timeout_s: float | None = None) -> protocol.Response:
        """Send one command; its response, a refusal included.

        Raises:
            ResponseTimeout: No response within ``timeout_s``.
            ConnectionLost: The connection broke.
        """
        line = protocol.encode_command(command, self.subject)
        async with self.send_turn():
            self._lines.clear()  # an answer that came twice would be taken for that to this command
            self._outstanding = command
            await self._write(line)
            return await self._outstanding_response(command, timeout_s or self.timeouts.answer)

    async def collect_late_response(self) -> None:
        """Receive the outstanding response, if there is one.

        Raises:
            ConnectionLost: It does not come, or the server is gone: open another connection.
        """
        if self._outstanding is not None:
            await self._outstanding_response(self._outstanding, self.timeouts.answer)
        if self.reader.at_eof():
            raise self._closed()

    async def take_control(self, timeout_s: float | None = None) -> None:
        """Become the client that may command; on LinuxCNC 2.9 the previous one loses control.

        Raises:
            DeviceError: The password is wrong.
        """
        password = self.settings.enable_password.get_secret_value()
        answer = await self.request(f"set enable {password}", timeout_s)
        if not answer.accepted:
            action = "Set enable_password in the password_file to linuxcncrsh's own (--enablepw)"
            raise self.error(DeviceError, "refuses the enable password", action)

    async def close(self) -> None:
        """Close the connection; closing twice is harmless."""
        self.writer.transport.abort()
        with suppress(OSError):
            await self.writer.wait_closed()

    def error(self, kind: type[ErrorT], problem: str, action: str | None = None) -> ErrorT:
        """The error for what this controller does."""
        return kind(problem, subject=self.subject, action=action)

    async def _greet(self) -> None:
        password = self.settings.connect_password.get_secret_value()
        await self._write(protocol.encode_command(f"hello {password} {_CLIENT}", self.subject))
        patience = _patience(self.timeouts.answer)
        try:
            while (line := await self._line(patience)).lower().startswith("warning:"):
                pass
        except TimeoutError:
            if self._buffer.rest:
                raise self._not_linuxcncrsh(self._buffer.rest) from None
            problem = "is frozen: it accepts the connection but does not respond"
            action = "Check that linuxcncrsh listens there, and restart LinuxCNC"
            raise self.error(ResponseTimeout, problem, action) from None
        match line.split():
            case ["HELLO", "ACK", *server]:
                self.server = " ".join(server)
            case ["HELLO", "NAK"]:
                action = "Set connect_password in the password_file to linuxcncrsh's own (--connectpw)"
                raise self.error(DeviceError, "refuses the connect password", action)
            case _:
                raise self._not_linuxcncrsh(line)
        await self._write(protocol.encode_command("set echo off", self.subject))
        with suppress(TimeoutError):  # the only response, if any, is the echo
            await self._line(_patience(self.timeouts.explanation))
        await self.request("set verbose on")

    def _not_linuxcncrsh(self, said: str) -> DeviceError:
        action = "Check controller.host and controller.port"
        return self.error(DeviceError, f"is no linuxcncrsh, it says {said[:_SHOWN]!r}", action)

    async def _write(self, line: bytes) -> None:
        self._record(TrafficDirection.SENT, line)
        try:
            self.writer.write(line)
            await self.writer.drain()
        except OSError as error:
            raise self._closed() from error

    async def _outstanding_response(self, command: str, timeout_s: float) -> protocol.Response:
        patience, remarks = _patience(timeout_s), list[str]()
        try:
            while (answer := protocol.parse_response(line := await self._line(patience), command)) is None:
                if explanation := protocol.parse_explanation(line):
                    remarks.append(explanation)
                    left_s = patience.left_s(protocol.loop_time())
                    patience = _patience(min(left_s, self.timeouts.explanation))
        except TimeoutError:
            if remarks:  # 2.10 refuses without a NAK while another client moves the machine
                self._outstanding = None
                return protocol.Response(accepted=False, explanations=tuple(remarks))
            asked = " ".join(command.split()[:2])  # no passwords in messages
            _log.warning("%s: no answer to '%s' within %g s", self.subject, asked, timeout_s)
            problem = f"is frozen: it is connected, but did not answer '{asked}' within {timeout_s:g} s"
            raise self.error(ResponseTimeout, problem, "Restart LinuxCNC, and find out why") from None
        self._outstanding = None
        return protocol.Response(answer.accepted, answer.text, tuple(remarks))

    async def _line(self, patience: Patience) -> str:
        while not self._lines:
            if (left_s := patience.left_s(protocol.loop_time())) <= 0.0:
                raise TimeoutError
            try:
                async with asyncio.timeout(min(left_s, _SLICE_S)):
                    try:
                        data = await self.reader.read(_CHUNK)
                    except OSError:
                        data = b""
            except TimeoutError:
                continue
            self._record(TrafficDirection.RECEIVED, data)
            if not data:
                _log.warning("%s: the connection was closed", self.subject)
                raise self._closed()
            self._lines.extend(self._buffer.feed(data))
        return self._lines.popleft()

    def _closed(self) -> ConnectionLost:
        what, action = "it was ended or restarted", "Start LinuxCNC if it does not run"
        if not self.server:  # it counts those that have left as well
            what = "it was ended, or takes no more clients than the --sessions that it was started with"
            action = "Restart LinuxCNC, with linuxcncrsh without --sessions"
        return self.error(ConnectionLost, f"closed the connection: {what}", action)

    def _record(self, direction: TrafficDirection, data: bytes) -> None:
        if self._wire.is_on:
            self._wire.add(direction, without_passwords(data, self.settings))  # traces are handed to others


def _patience(seconds: float) -> Patience:
    """With what begins to wait now."""
    return Patience(seconds, _SLICE_S, protocol.loop_time())


def without_passwords(data: bytes, settings: ControllerSettings) -> bytes:
    """Traffic with every password masked as a whole, even where one begins with the other."""
    for secret in (settings.connect_password, settings.enable_password):
        password = re.escape(secret.get_secret_value().encode())
        data = re.sub(rb"(?<= )" + password + rb"(?![^\s])", b"***", data)
    return data


async def _connect(
    settings: ControllerSettings, timeouts: protocol.Timeouts
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    try:
        async with asyncio.timeout(timeouts.connect):
            return await asyncio.open_connection(settings.host, settings.port)
    except OSError as error:
        number = error.errno or 0  # negative from getaddrinfo, which has its own text
        reason = f": {os.strerror(number) if number > 0 else error.strerror}" if number else ""
        action = "Switch its computer on, check the network and its firewall, or correct controller.host"
        if number == errno.ECONNREFUSED:
            action = "Start LinuxCNC with DISPLAY = linuxcncrsh --port N, or correct controller.port"
        action = SHORTAGES.get(number, ("", action))[1]
        problem = f"cannot be reached{reason or f' within {timeouts.connect:g} s'}"
        raise ConnectionLost(problem, subject=protocol.subject_of(settings), action=action) from error
