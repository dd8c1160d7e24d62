"""A server that follows a script, and drivers that talk to it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import suppress
from enum import Enum, auto
from typing import Any

import pytest

from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.linuxcnc.protocol import Timeouts
from drivers.wire_trace import WireTrace
from hexacell.cell.robot import ControllerSettings
from hexacell.kinematics.pose import Pose


def said(text: str) -> list[tuple[str, bytes]]:
    """Exchanges, separated by ``|``: ``get estop: ON`` is answered by ESTOP ON, ``set mode mdi`` by ACK.

    ``set machine on: NAK`` is refused.
    """
    exchanges = []
    for exchange in text.split(" | "):
        asked, _, answer = exchange.partition(": ")
        verb, name = asked.split()[:2]
        if verb == "get":
            exchanges.append((asked, f"{name.upper()} {answer}\r\n".encode()))
        else:
            exchanges.append((asked, f"SET {name.upper()} {answer or 'ACK'}\n\r".encode()))
    return exchanges


TARGET = Pose(10.0, 20.0, 560.0, 5.0, -4.0, 3.0)
MOVE_S = 3.0
MDI = (
    "set mdi G21 G53 G93 G1 X10.00000000 Y20.00000000 Z560.00000000 A5.00000000 B-4.00000000 C3.00000000 "
    "F20.00000000"
)
ACK, NAK = b"SET MDI ACK\n\r", b"SET MDI NAK\n\r"
ARRIVED = b"ABS_ACT_POS 10.000000 20.000000 560.000000 5.000000 -4.000000 3.000000\r\n"
HALF_WAY = b"ABS_ACT_POS 5.000000 10.000000 555.000000 2.500000 -2.000000 1.500000\r\n"
MOVED = [(MDI, ACK), ("get abs_act_pos", ARRIVED)]
[RESTORED] = said("set mdi G94 G0")
[NO_ERROR] = said("get error: OK")
[AGAIN_IN_CONTROL] = said("set enable EMCTOO")
[ABORT] = said("set abort")
JOINTS = ("get joint_pos", b"JOINT_POS 1 2 3 4 5 6\r\n")
REFUSED = [(MDI, NAK), *said("get enable: ON")]
NO_ESTOP, IN_ESTOP = said("get estop: OFF"), said("get estop: ON")
IS_ON, IS_OFF = said("get machine: ON"), said("get machine: OFF")
HOMED = said("get joint_homed: YES YES YES YES YES YES")
NOT_HOMED = said("get joint_homed: NO YES NO NO NO NO")
OFF, READY = [*NO_ESTOP, *IS_OFF], [*NO_ESTOP, *IS_ON, *HOMED]
SWITCHING_ON = [*OFF, *said("set machine on"), *IS_ON]
ON_NOT_HOMED = [*NO_ESTOP, *IS_ON, *NOT_HOMED]
MDI_MODE = said("set mode mdi | get mode: MDI")
[UNITS, CODES, OFFSETS, OVERRIDE] = OWN_COORDINATES = said(
    "get user_linear_units: MM | get program_codes: G80 G17 G40 G21 G90 G94 G54 G49 G92.2 F0 S0 | "
    "get pos_offset: 0.000000 0.000000 -0.000000 0.000000 0.000000 0.000000 | get feed_override: 100"
)
TAKING_CONTROL = said(
    "set enable EMCTOO | get error: left over from somebody else | get error: OK | set set_wait done"
)
IN_JOINT_MODE = said("set mode manual | get teleop_enable: NO | get error: OK")
HOMING = [*said("set home -1"), *NOT_HOMED, *HOMED]


PATIENT = Timeouts(explanation=0.05, poll=0.002)
IMPATIENT = Timeouts(
    answer=0.4,
    command=0.4,
    explanation=0.05,
    poll=0.002,
    arrival=0.02,
    stop=0.6,
    switch=0.02,
    reconnect=0.2,
)
"""For tests in which something does not happen."""


class Then(Enum):
    """What a script can do beside sending bytes."""

    SAY_NOTHING = auto()
    HANG_UP = auto()


class Pause(asyncio.Event):
    """A place in a script at which the server waits until the test sets it."""

    def __init__(self) -> None:
        super().__init__()
        self.reached = asyncio.Event()

    async def reached_by(self, order: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """The task of this order, once the server waits here."""
        task = asyncio.create_task(order)
        await self.reached.wait()
        return task


Step = bytes | Pause | Then
Exchange = tuple[str, Step] | tuple[str, Step, Step] | tuple[str, Step, Step, Step]

GREETING: list[Exchange] = [
    ("hello EMC hexacell 1.0", b"HELLO ACK EMCNETSVR 1.1\r\n"),
    ("set echo off", b"set echo off\r\n"),
    *said("set verbose on | set enable EMCTOO"),
]
OPENING = [*GREETING, *said("set set_wait done | get inifile: /home/operator/machine.ini")]
AT_REST = b"JOINT_POS 0.000000 0.000000 0.000000 0.000000 -0.000000 0.000000\r\n"
STOPPED: list[Exchange] = [*said("set abort"), *[("get joint_pos", AT_REST)] * 3]
STOPPING = [*GREETING, *STOPPED]


class ScriptedServer:
    """Plays one conversation to each connection in turn, and remembers what did not follow it.

    ``afterwards`` answers what is asked again and again once a conversation has been played; the
    last of several answers is repeated.
    """

    def __init__(self, *conversations: list[Exchange]) -> None:
        self.deviations: list[str] = []
        self.afterwards: dict[str, bytes | list[bytes] | Callable[[], bytes]] = {}
        self.port = 0
        self.connections = 0
        self._conversing: set[asyncio.Task[None]] = set()
        self._left = [list(conversation) for conversation in conversations]
        self._waiting = iter(self._left)
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        self._server = await asyncio.start_server(self._converse, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    def stop_listening(self) -> None:
        """Connections go on, and no new one is taken."""
        assert self._server is not None
        self._server.close()

    async def close(self) -> None:
        assert self._server is not None
        self.stop_listening()
        for task in self._conversing:
            task.cancel()
        await asyncio.gather(*self._conversing)
        await self._server.wait_closed()

    def assert_followed(self) -> None:
        assert self.deviations == []
        assert [conversation for conversation in self._left if conversation] == []

    async def _converse(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._conversing.add(task)
        self.connections += 1
        conversation = next(self._waiting, None)
        if conversation is None:
            self.deviations.append("one connection more than the script has")
        with suppress(asyncio.CancelledError, OSError):
            while conversation is not None and (line := (await reader.readline()).decode()):
                if not await self._answer(line.removesuffix("\r\n"), conversation, writer):
                    break
        writer.transport.abort()

    async def _answer(self, line: str, conversation: list[Exchange], writer: asyncio.StreamWriter) -> bool:
        if not conversation and line in self.afterwards:
            writer.write(self._afterwards(line))
            return True
        expected, *steps = conversation.pop(0) if conversation else ("nothing",)
        if line != expected:
            self.deviations.append(f"{line!r} came where {expected!r} was expected")
            return False
        for step in steps:
            if step is Then.HANG_UP:
                return False
            if isinstance(step, Pause):
                step.reached.set()
                await step.wait()
            elif isinstance(step, bytes):
                writer.write(step)
        return True

    def _afterwards(self, line: str) -> bytes:
        answer = self.afterwards[line]
        if isinstance(answer, bytes):
            return answer
        if callable(answer):
            return answer()
        return answer.pop(0) if len(answer) > 1 else answer[0]


class Play:
    """Scripts, and drivers that talk to servers which follow them."""

    GREETING = GREETING
    OPENING = OPENING
    STOPPING = STOPPING
    STOPPED = STOPPED
    AT_REST = AT_REST
    SILENCE = Then.SAY_NOTHING
    HANG_UP = Then.HANG_UP
    Pause = Pause
    IMPATIENT = IMPATIENT

    def __init__(self) -> None:
        self.patience = PATIENT
        self.servers: list[ScriptedServer] = []
        self._drivers: list[LinuxcncrshController] = []

    async def driver(
        self, *conversations: list[Exchange], trace: WireTrace | None = None, **settings: object
    ) -> LinuxcncrshController:
        """A driver for a server that plays ``conversations``, one to each connection."""
        server = ScriptedServer(*conversations)
        self.servers.append(server)
        await server.start()
        stated = {"config": "machine.ini", "port": server.port, **settings}
        values = ControllerSettings.model_validate(stated)
        self._drivers.append(LinuxcncrshController(values, trace=trace, timeouts=self.patience))
        return self._drivers[-1]

    async def opened(
        self, conversation: list[Exchange], *others: list[Exchange], **settings: Any
    ) -> LinuxcncrshController:
        """The same, connected: ``conversation`` goes on after the opening."""
        driver = await self.driver([*OPENING, *conversation], *others, **settings)
        await driver.open()
        return driver

    async def end(self) -> None:
        """Close everything; fail unless every conversation was played to its end."""
        for driver in self._drivers:
            driver._has_changed_modes = False  # a test that is about restoring them closes it itself
            await driver.close()
        for server in self.servers:
            await server.close()
        for server in self.servers:
            server.assert_followed()


@pytest.fixture
async def play() -> AsyncIterator[Play]:
    """Servers that follow scripts; a test fails unless each script was played to its end."""
    playing = Play()
    yield playing
    await playing.end()
