"""One link to a program that serves a controller: requests, their answers, and its end.

A link that broke stays broken: an answer that is late, garbled or to nothing that was asked ends it, and
with it the program's stdin or its connection, at which the program stops the robot.
"""

import asyncio
import json
import logging
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Generic, Self, TypeVar

from pydantic import ValidationError

from drivers.controllers.adapter.local_program import LocalProgram
from drivers.controllers.adapter.masking import Masking, revealed
from drivers.controllers.adapter.messages import LONGEST_LINE, Answer, Failed, Hello, Message
from drivers.controllers.adapter.options import Program
from drivers.controllers.adapter.program_process import ProgramProcess
from drivers.controllers.adapter.served_robot import VERSION
from drivers.errors import ConnectionLost, ResponseTimeout
from drivers.wire_trace import LineRecord, TraceRecorder, TrafficDirection
from hexacell.cell.fields import first_mistake
from hexacell.clock import Patience
from hexacell.errors import DeviceError, UsageError

AnswerT = TypeVar("AnswerT", bound=Message)

_log = logging.getLogger("drivers.controllers.adapter")

_AT_ANY_TIME = frozenset({"hello", "status", "position", "stop"})
_SLICE_S = 0.05
_CHUNK = 65_536
_SHOWN = 400


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Longest waits, s of real time. A move may take twice its duration and ``beyond_move``."""

    connect: float = 30.0
    answer: float = 5.0
    command: float = 20.0
    arrival: float = 1.0
    reload: float = 120.0
    reconnect: float = 60.0
    beyond_move: float = 10.0
    stop: float = 5.0
    poll: float = 0.05
    closing: float = 5.0


@dataclass(eq=False)
class Request(Generic[AnswerT]):
    """What was asked; ``answer`` is None where the link broke before it came."""

    do: str
    kind: type[AnswerT]
    on_way: Callable[[list[float]], str | None]
    answer: asyncio.Future[AnswerT | Failed | None] = field(
        default_factory=lambda: asyncio.get_running_loop().create_future()
    )


class Link:
    """The program, from its start to its end, or one connection to it.

    Attributes:
        hello: what it said of itself.
        order: the last request of those that are asked one after another.
    """

    hello: Hello

    def __init__(self, program: Program, timeouts: Timeouts, recorder: TraceRecorder | None) -> None:
        self._program, self._timeouts = program, timeouts
        self._wire = LineRecord(program.name, recorder)
        self._masked = Masking(program.settings)
        self.order: Request[Any] | None = None
        self._pending: dict[int, Request[Any]] = {}
        self._asked = 0
        self._error: ConnectionLost | None = None
        self._process: ProgramProcess | LocalProgram | None = None
        self._reading: asyncio.Task[None] | None = None

    @classmethod
    async def open(
        cls,
        program: Program,
        timeouts: Timeouts,
        recorder: TraceRecorder | None,
        hello_s: float,
        **told: object,
    ) -> Self:
        """Start the program, or connect to it, and greet it with what else it is ``told``; nothing moves.

        Raises:
            ConnectionLost: it is not there, ends, or does not answer within ``hello_s``.
            DeviceError: it cannot be started, refuses, or is of another version or unit.
        """
        link = cls(program, timeouts, recorder)
        await link._begin()
        try:
            await link._greet(hello_s, told)
        except BaseException:
            await link.close()
            raise
        _log.info("%s: connected to %s, %s", program.name, link.hello.name, link.hello.description)
        return link

    @property
    def is_broken(self) -> bool:
        """Whether it can be used no longer."""
        return self._error is not None

    async def ask(
        self,
        do: str,
        kind: type[AnswerT],
        timeout_s: float | None = None,
        arguments: Mapping[str, object] = MappingProxyType({}),
        on_way: Callable[[list[float]], str | None] = lambda at: (
            f"says that it is at {at}, and was not to move"
        ),
    ) -> AnswerT | Failed:
        """Ask, and give the answer. ``on_way`` says what is wrong with a pose on the way, if anything is.

        Raises:
            TimeoutError: an order is not done in time, and goes on.
            ConnectionLost: the link is broken, or breaks.
        """
        if is_order := do not in _AT_ANY_TIME:
            await self.settle(self._timeouts.answer)
        self.require_sound()
        request = Request(do, kind, on_way)
        if is_order:
            self.order = request
        self._asked += 1
        self._pending[self._asked] = request
        self._send({"id": self._asked, "do": do, **arguments})
        timeout_s = timeout_s or self._timeouts.answer
        if not await _answered(request, timeout_s):
            if is_order:
                raise TimeoutError
            self.fail(f"is frozen: it did not answer '{do}' within {timeout_s:g} s", ResponseTimeout)
        self.require_sound()
        answer = request.answer.result()
        assert answer is not None  # noqa: S101 - of a sound link
        return answer

    async def settle(self, timeout_s: float) -> None:
        """Wait for the answer to the last order; without it the link breaks: nothing may follow it."""
        if self.order is not None and not await _answered(self.order, timeout_s):
            self.fail(f"did not answer '{self.order.do}' within {timeout_s:g} s", ResponseTimeout)

    async def has_ended(self, timeout_s: float) -> bool:
        """Whether the last motion that was asked for has been answered in this time."""
        if self.order is None or self.order.do not in {"move", "home"}:
            return True
        return await _answered(self.order, timeout_s)

    def require_sound(self) -> None:
        """Raise what broke the link, if it is broken."""
        if (error := self._error) is not None:
            raise type(error)(error.problem, subject=error.subject, action=error.action)

    def fail(
        self,
        problem: str,
        kind: type[ConnectionLost] = ConnectionLost,
        action: str | None = "Look at the program's own messages in the log",
        *,
        is_closed: bool = False,
    ) -> None:
        """Break the link: the program's stdin or its connection ends, at which it stops the robot."""
        self._writer.close()
        if self._error is not None:
            return
        self._error = kind(self._masked(problem), subject=self._program.name, action=action)
        _log.log(logging.DEBUG if is_closed else logging.WARNING, "%s", self._error)
        for request in self._pending.values():
            if not request.answer.done():
                request.answer.set_result(None)

    async def close(self) -> None:
        """End it; a program that does not end in time is killed. Closing twice is harmless."""
        self.fail("was closed", is_closed=True)
        if self._process is not None:
            await self._process.close(self._timeouts.closing)
        else:
            self._writer.transport.abort()
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.gather(self._reading, return_exceptions=True)

    async def _begin(self) -> None:
        program = self._program
        try:
            if program.robot is not None:
                self._process = await LocalProgram.start(program.robot(), LONGEST_LINE)
            elif program.command:
                self._process = await ProgramProcess.start(program, self._masked, LONGEST_LINE)
            else:
                async with asyncio.timeout(self._timeouts.answer):
                    self._reader, self._writer = await asyncio.open_connection(
                        *program.address, limit=LONGEST_LINE
                    )
            if self._process is not None:
                self._reader, self._writer = self._process.stdout, self._process.stdin
        except OSError as error:  # of which TimeoutError is one
            number = error.errno or 0  # negative from getaddrinfo, which has its own text
            reason = os.strerror(number) if number > 0 else error.strerror or "no answer"
            if not program.command:
                action = "Start the program that serves there, or correct controller.options.address"
                problem = f"cannot be reached: {reason}"
                raise ConnectionLost(problem, subject=program.name, action=action) from error
            problem = f"'{program.command[0]}' cannot be started: {reason}"
            action = "Correct controller.options.command"
            raise DeviceError(problem, subject=program.name, action=action) from error
        self._reading = asyncio.create_task(self._read())

    async def _greet(self, timeout_s: float, told: Mapping[str, object]) -> None:
        settings = revealed(self._program.settings)
        hello = await self.ask(
            "hello", Hello, timeout_s, {"version": VERSION, **told, "settings": settings}
        )
        name = self._program.name
        if isinstance(hello, Failed):
            problem = self._masked(f"refuses to begin: {hello.reason}")
            raise DeviceError(problem, subject=name, action=hello.action)
        if hello.version != VERSION:
            raise DeviceError(
                f"has version {hello.version} of the adapter protocol, hexacell has {VERSION}",
                subject=name,
                action="Install versions of both that fit",
            )
        for unit, own in ((hello.length, "mm"), (hello.angle, "deg")):
            if unit != own:
                problem, action = f"counts in {unit!r}, not in {own}", f"Have its program convert to {own}"
                raise DeviceError(problem, subject=name, action=action)
        self.hello = hello

    def _send(self, message: Mapping[str, object]) -> None:
        line = json.dumps(message, ensure_ascii=False, allow_nan=False).encode() + b"\n"
        if len(line) > LONGEST_LINE:
            problem = f"a message of {len(line)} bytes is longer than the {LONGEST_LINE} of the protocol"
            action = "Shorten controller.options.settings"
            raise UsageError(problem, subject=self._program.name, action=action)
        self._record(TrafficDirection.SENT, line)
        self._writer.write(line)

    async def _read(self) -> None:
        try:
            while True:
                line = await self._reader.readuntil(b"\n")
                self._record(TrafficDirection.RECEIVED, line)
                if problem := self._take(line):
                    self.fail(problem)
                    break
        except asyncio.LimitOverrunError:
            self.fail(f"sent a line of more than {LONGEST_LINE} bytes")
        except (asyncio.IncompleteReadError, OSError) as end:
            rest = end.partial if isinstance(end, asyncio.IncompleteReadError) else b""
            self._record(TrafficDirection.RECEIVED, rest)
            self._writer.close()
            if isinstance(how := await self._ending(), ConnectionLost):
                self.fail(how.problem, type(how), how.action)
            else:
                self.fail(how + (f", in the middle of a line: {_shown(rest)}" if rest else ""))
        with suppress(OSError):  # a program that waits for its reader would not see that its stdin ended
            while await self._reader.read(_CHUNK):
                pass

    def _take(self, line: bytes) -> str | None:
        """Hand an answer to who waits for it; what is wrong with it, if anything is."""
        try:
            answer = Answer.model_validate_json(line)
        except ValidationError as refusal:
            return f"sent {_shown(line)}, which is no answer: {first_mistake(refusal, 'the line')}"
        if (request := self._pending.get(answer.id)) is None:
            if answer.at is not None:
                return f"is on its way after it said that request {answer.id} was over: {_shown(line)}"
            return f"answers request {answer.id}, which was answered before or never asked: {_shown(line)}"
        if answer.at is not None:
            return request.on_way(answer.at)
        found: Message | None = answer.failed
        if answer.done is not None:
            try:
                found = request.kind.model_validate(answer.done)
            except ValidationError as refusal:
                return f"answers '{request.do}' with {_shown(line)}: {first_mistake(refusal, 'done')}"
        del self._pending[answer.id]
        request.answer.set_result(found)
        return None

    async def _ending(self) -> ConnectionLost | str:
        """How it ended."""
        if self._process is not None:
            return await self._process.ending()
        return "closed the connection: it was ended or restarted, or serves somebody else"

    def _record(self, direction: TrafficDirection, data: bytes) -> None:
        if self._wire.is_on:
            self._wire.add(direction, self._masked(data.decode("utf-8", "replace")).encode())


async def _answered(request: Request[Any], timeout_s: float) -> bool:
    """Whether it is answered within this time of a process that is scheduled."""
    loop = asyncio.get_running_loop()
    patience = Patience(timeout_s, _SLICE_S, loop.time())
    while not request.answer.done():
        if (left_s := patience.left_s(loop.time())) <= 0.0:
            return False
        await asyncio.wait([request.answer], timeout=min(left_s, _SLICE_S))
    return True


def _shown(line: bytes) -> str:
    return repr(line[:_SHOWN].decode("utf-8", "replace").strip())
