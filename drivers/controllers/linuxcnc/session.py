"""Keeping one usable connection, and a second one for looking on and for stopping."""

from __future__ import annotations

import asyncio

from drivers.controllers.errors import ConnectionLost
from drivers.controllers.linuxcnc import startup as readiness
from drivers.controllers.linuxcnc.commands import ControllerCommands
from drivers.controllers.linuxcnc.connection import Connection
from drivers.controllers.linuxcnc.send_arbiter import SendArbiter
from drivers.controllers.linuxcnc.settings import Address, Timeouts
from drivers.controllers.linuxcnc.status_channel import StatusConnection
from drivers.controllers.linuxcnc.stop import stop_in_place
from drivers.interfaces import ControllerStatus
from drivers.wire_trace import TraceRecorder
from hexacell.errors import DeviceError


class Session:
    """From the first connection to the last; a line that broke is replaced by the next ``in_step``.

    Attributes:
        stops: how often ``stop`` was called; whoever waits for a motion compares.
    """

    def __init__(self, address: Address, patience: Timeouts, trace: TraceRecorder | None) -> None:
        self.stop_count = 0
        self._address = address
        self._patience = patience
        self._trace = trace
        self._commands: ControllerCommands | None = None
        self._is_open = False
        self._has_control = True
        self._stop_turn = asyncio.Lock()
        self._may_speak = asyncio.Event()
        self._may_speak.set()
        self._floor = SendArbiter()
        self._lookout = StatusConnection(address, patience, self._floor, trace)

    async def open(self) -> ControllerCommands:
        """The first connection; nothing is left behind if there is none."""
        was_open, self._is_open = self._is_open, True
        try:
            return await self.synchronized()
        except BaseException:
            self._is_open = was_open
            raise

    async def synchronized(self) -> ControllerCommands:
        """A connection on which no answer is owed, and which has control unless another took it.

        Raises:
            DeviceError: The session is not open, or there is no connection to be had.
        """
        self._expect_open()
        await self._may_speak.wait()
        if self._commands is not None:
            try:
                await self._commands.connection.collect_late_response()
            except ConnectionLost:
                await self._drop()
        if self._commands is None:
            self._commands = await self._connected()
        elif not self._has_control:
            await self._commands.connection.take_control()
        self._has_control = True
        return self._commands

    async def in_control(self) -> ControllerCommands:
        """The same, after taking control from whoever has it."""
        self._has_control = False
        self._lookout.reset_complaints()
        return await self.synchronized()

    async def reconnect(self) -> ControllerCommands:
        """The same, once a controller that may be starting anew can be reached.

        Raises:
            ConnectionLost: It cannot, for as long as ``patience.comeback``.
        """
        give_up = _now() + self._patience.reconnect
        while True:
            try:
                return await self.synchronized()
            except ConnectionLost:
                if _now() > give_up:
                    raise
                await asyncio.sleep(self._patience.poll)

    async def status(self) -> ControllerStatus:
        """How the machine is, over a connection of its own: the first one may be waiting for a move.

        Raises:
            DeviceError: The session is not open, or it cannot be asked.
        """
        self._expect_open()
        await self._may_speak.wait()
        return await self._lookout.status()

    async def stop(self, tolerance_mm: float) -> None:
        """Stop motion over a connection of its own; the first one is silent meanwhile.

        Raises:
            DeviceError: The machine could not be stopped, or it is not known whether it was.
        """
        self.stop_count += 1
        async with self._stop_turn:
            self._may_speak.clear()
            try:
                ready = await self._lookout.hand_over()
                await stop_in_place(self._address, self._patience, tolerance_mm, self._trace, ready)
            finally:
                self._has_control = False
                self._may_speak.set()

    async def close(self) -> None:
        """Let the line go; closing twice is harmless."""
        self._is_open = False
        await self._lookout.close()
        await self._drop()

    async def _connected(self) -> ControllerCommands:
        async with self._floor.kept():
            connection = await Connection.open(self._address, self._patience, self._trace)
        connection.may_speak, connection.floor = self._may_speak, self._floor
        commands = ControllerCommands(connection, self._address.name)
        try:
            await readiness.acknowledge_on_completion(commands)
            self._expect_open()  # it may have been closed in the meantime
        except BaseException:
            await connection.close()
            raise
        return commands

    async def _drop(self) -> None:
        commands, self._commands = self._commands, None
        if commands is not None:
            await commands.connection.close()

    def _expect_open(self) -> None:
        if not self._is_open:
            raise DeviceError("is not connected", subject=self._address.name, action="Open it first")


def _now() -> float:
    return asyncio.get_running_loop().time()
