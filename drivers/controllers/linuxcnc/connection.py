"""One conversation with linuxcncrsh: the greeting, questions one at a time, never out of step."""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from collections import deque
from typing import Self

from drivers.controllers.errors import ConnectionLost, ResponseTimeout
from drivers.controllers.linuxcnc.protocol import (
    LineBuffer,
    Response,
    encode,
    parse_explanation,
    parse_response,
)
from drivers.controllers.linuxcnc.send_arbiter import SendArbiter
from drivers.controllers.linuxcnc.settings import Address, Timeouts
from drivers.wire_trace import TraceEntry, TraceRecorder, TrafficDirection
from hexacell.errors import DeviceError, UsageError

_CLIENT = "hexacell 1.0"
_CHUNK = 4096
_SHOWN = 80


class Connection:
    """A connected, greeted client that has taken control.

    The caller asks one question at a time. When a wait is cancelled or runs out, the answer is
    still owed: ``catch_up`` collects it before the next question, so that a late answer is never
    taken for that of another command. While ``may_speak`` is cleared, nothing is asked, and
    connections that share a ``floor`` are never heard at the same moment.
    """

    def __init__(
        self,
        address: Address,
        patience: Timeouts,
        recorder: TraceRecorder | None,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        self.server = ""
        self.may_speak = asyncio.Event()
        self.may_speak.set()
        self.floor = SendArbiter()
        self._recorder = recorder
        self._address = address
        self._patience = patience
        self._reader = reader
        self._writer = writer
        self._buffer = LineBuffer()
        self._lines: deque[str] = deque()
        self._owed: str | None = None

    @classmethod
    async def open(
        cls,
        address: Address,
        patience: Timeouts,
        recorder: TraceRecorder | None = None,
        *,
        commanding: bool = True,
    ) -> Self:
        """Connect, greet, silence the echo, ask for acknowledgements and, if ``commanding``, take control.

        Raises:
            ConnectionLost: Nothing listens there, or it says nothing.
            DeviceError: Something else listens there, or a password is wrong.
        """
        connection = cls(address, patience, recorder, *await _connect(address, patience))
        try:
            await connection._greet()
            if commanding:
                await connection.take_control()
        except BaseException:
            await connection.close()
            raise
        return connection

    async def ask(self, command: str, patience_s: float | None = None) -> Response:
        """The answer to one command, a refusal included.

        Raises:
            ResponseTimeout: It did not come within ``patience_s``.
            ConnectionLost: The line broke.
        """
        line = self._encoded(command)
        await self.may_speak.wait()
        async with self.floor.taken():
            self._owed = command
            await self._write(line)
            return await self._owed_answer(patience_s or self._patience.answer)

    async def collect_late_response(self) -> None:
        """Collect an answer that nobody waited for to the end.

        Raises:
            ConnectionLost: It does not come either, or the server is gone: open another connection.
        """
        if self._owed is not None:
            await self._owed_answer(self._patience.answer)
        if self._reader.at_eof():
            raise ConnectionLost("closed the connection", subject=self._address.name)

    async def take_control(self, patience_s: float | None = None) -> None:
        """Become the client that may command; on LinuxCNC 2.9 the one before loses control.

        Raises:
            DeviceError: The password is wrong.
        """
        answer = await self.ask(f"set enable {self._address.enable_password}", patience_s)
        if not answer.accepted:
            raise DeviceError(
                "refuses the enable password",
                subject=self._address.name,
                action="Set controller.enable_password to linuxcncrsh's own (--enablepw)",
            )

    async def close(self) -> None:
        """Let the line go; closing twice is harmless."""
        self._writer.transport.abort()
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()

    async def _greet(self) -> None:
        await self._write(self._encoded(f"hello {self._address.connect_password} {_CLIENT}"))
        self.server = self._server_in(await self._first_line())
        await self._write(self._encoded("set echo off"))
        with contextlib.suppress(TimeoutError):  # answered by its echo alone, if at all
            await self._line(_now() + self._patience.explanation)
        await self.ask("set verbose on")

    async def _first_line(self) -> str:
        give_up = _now() + self._patience.answer
        try:
            while (line := await self._line(give_up)).lower().startswith("warning:"):
                pass
        except TimeoutError:
            if self._buffer.rest:
                raise self._stranger(self._buffer.rest) from None
            raise ResponseTimeout(
                "takes the connection but says nothing",
                subject=self._address.name,
                action="Check that linuxcncrsh listens there, and restart LinuxCNC if it hangs",
            ) from None
        return line

    def _server_in(self, line: str) -> str:
        match line.split():
            case ["HELLO", "ACK", *server]:
                return " ".join(server)
            case ["HELLO", "NAK"]:
                raise DeviceError(
                    "refuses the connect password",
                    subject=self._address.name,
                    action="Set controller.connect_password to linuxcncrsh's own (--connectpw)",
                )
        raise self._stranger(line)

    def _stranger(self, said: str) -> DeviceError:
        return DeviceError(
            f"is no linuxcncrsh, it says {said[:_SHOWN]!r}",
            subject=self._address.name,
            action="Check controller.host and controller.port",
        )

    def _encoded(self, command: str) -> bytes:
        try:
            return encode(command)
        except ValueError as error:
            raise UsageError(str(error), subject=self._address.name) from error

    async def _write(self, line: bytes) -> None:
        self._record(TrafficDirection.SENT, line)
        try:
            self._writer.write(line)
            await self._writer.drain()
        except OSError as error:
            raise ConnectionLost("closed the connection", subject=self._address.name) from error

    async def _owed_answer(self, patience_s: float) -> Response:
        assert self._owed is not None  # noqa: S101 - both callers see to it
        answer = await self._answer_to(self._owed, patience_s)
        self._owed = None
        return answer

    async def _answer_to(self, command: str, patience_s: float) -> Response:
        give_up = _now() + patience_s
        remarks: list[str] = []
        try:
            while (answer := parse_response(line := await self._line(give_up), command)) is None:
                if explanation := parse_explanation(line):
                    remarks.append(explanation)
                    give_up = min(give_up, _now() + self._patience.explanation)
        except TimeoutError:
            if remarks:  # 2.10 refuses what another client's motion holds up without a NAK
                return Response(accepted=False, explanations=tuple(remarks))
            asked = " ".join(command.split()[:2])  # no passwords in messages
            raise ResponseTimeout(
                f"did not answer '{asked}' within {patience_s:g} s",
                subject=self._address.name,
                action="Check that LinuxCNC still runs",
            ) from None
        return Response(answer.accepted, answer.text, tuple(remarks))

    async def _line(self, give_up: float) -> str:
        while not self._lines:
            async with asyncio.timeout_at(give_up):
                data = await self._read()
            self._lines.extend(self._buffer.feed(data))
        return self._lines.popleft()

    async def _read(self) -> bytes:
        try:
            data = await self._reader.read(_CHUNK)
        except OSError:
            data = b""
        self._record(TrafficDirection.RECEIVED, data)
        if not data:
            raise ConnectionLost(
                "closed the connection", subject=self._address.name, action="Check that LinuxCNC still runs"
            )
        return data

    def _record(self, direction: TrafficDirection, data: bytes) -> None:
        if self._recorder is None or not data:
            return
        for password in (self._address.connect_password, self._address.enable_password):
            data = data.replace(f" {password}".encode(), b" ***")  # traces are passed around
        self._recorder(TraceEntry(time.time(), self._address.name, direction, data))


async def _connect(
    address: Address, patience: Timeouts
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    start = "Start LinuxCNC with DISPLAY = linuxcncrsh --port N, or correct controller.host and .port"
    try:
        async with asyncio.timeout(patience.connect):
            return await asyncio.open_connection(address.host, address.port)
    except TimeoutError:
        problem = f"cannot be reached within {patience.connect:g} s"
        raise ConnectionLost(problem, subject=address.name, action=start) from None
    except OSError as error:
        number = error.errno or 0  # negative from getaddrinfo, which brings its own words
        reason = os.strerror(number) if number > 0 else error.strerror
        problem = f"cannot be reached: {reason or error}"
        raise ConnectionLost(problem, subject=address.name, action=start) from error


def _now() -> float:
    return asyncio.get_running_loop().time()
