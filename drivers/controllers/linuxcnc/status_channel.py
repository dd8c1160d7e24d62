"""The status connection: it reads the machine's status while the command connection waits for a move."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext

from drivers.controllers.linuxcnc.commands import CommandChannel, ControllerCommands, ErrorMessages
from drivers.controllers.linuxcnc.connection import Connection, SendArbiter
from drivers.controllers.linuxcnc.protocol import Address, Timeouts
from drivers.errors import ConnectionLost
from drivers.interfaces import ControllerStatus
from drivers.wire_trace import TraceRecorder

RELEASE_TIMEOUT_S = 0.05
"""Longest wait for a query in progress; it is answered within a millisecond."""


class StatusConnection:
    """Reads the machine's status without taking control, which queries do not need.

    Error messages are reported of a machine that was enabled and became disabled, those that an order
    read included. The messages of a machine that was never enabled are left to the order that enables it.
    """

    def __init__(
        self,
        address: Address,
        timeouts: Timeouts,
        arbiter: SendArbiter,
        messages: ErrorMessages,
        trace: TraceRecorder | None,
    ) -> None:
        self._address = address
        self._timeouts = timeouts
        self._arbiter = arbiter
        self._trace = trace
        self._channel = CommandChannel(self._connect)
        self._messages = messages
        self._was_enabled = False
        self._query = asyncio.Lock()

    async def read(self) -> ControllerStatus:
        """The machine's status now; raises ``DeviceError`` if it cannot be read."""
        async with self._synchronized() as commands:
            return await self._read(commands)

    async def joints(self) -> tuple[float, ...] | None:
        """Where the joints are now; None before all are homed."""
        async with self._synchronized() as commands:
            return await commands.joints() if await commands.all_homed() else None

    def begin_disabled(self) -> None:
        """An order is about to enable the machine."""
        self._was_enabled, self._messages.for_status = False, []

    def begin_enabled(self) -> None:
        """An order has enabled the machine; no status may have been read since."""
        self._was_enabled = True

    async def release_connection(self) -> Connection | None:
        """Give the connection away for a stop; None if a query occupies it for too long."""
        try:
            async with asyncio.timeout(RELEASE_TIMEOUT_S):
                await self._query.acquire()
        except TimeoutError:
            return None
        try:
            commands, self._channel.commands = self._channel.commands, None
        finally:
            self._query.release()
        if commands is None:
            return None
        commands.connection.send_turn = nullcontext
        return commands.connection

    async def close(self) -> None:
        """Close the connection; closing twice is harmless."""
        await self._channel.close()

    @asynccontextmanager
    async def _synchronized(self) -> AsyncIterator[ControllerCommands]:
        """One query at a time; a connection that breaks is replaced at the next one."""
        async with self._query:
            commands = await self._channel.synchronized()
            try:
                yield commands
            except ConnectionLost:
                await self._channel.close()
                raise

    async def _read(self, commands: ControllerCommands) -> ControllerStatus:
        known = len(self._messages.for_status)
        # In this order: an emergency stop between the two is not taken for a machine that was switched off.
        enabled, estop = await commands.is_on("machine"), await commands.is_on("estop")
        heartbeat = await commands.get("joint_pos")
        if enabled and not estop:
            self._was_enabled = True
            # An order may have read the message of a machine that was disabled since it answered.
            del self._messages.for_status[:known]
        elif self._was_enabled:
            await commands.read_errors()
            messages = tuple(self._messages.for_status)
            return ControllerStatus(estop, enabled, messages, heartbeat)
        return ControllerStatus(estop, enabled, heartbeat=heartbeat)

    async def _connect(self) -> ControllerCommands:
        async with self._arbiter.exclusive():
            connection = await Connection.open(self._address, self._timeouts, self._trace, commanding=False)
        connection.send_turn = self._arbiter.query_turn
        return ControllerCommands(connection, self._address, self._messages)
