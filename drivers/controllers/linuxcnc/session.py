"""The session with one linuxcncrsh server: its connections, and who has control of the machine.

::

                 open                    stop, or in_control
      CLOSED -----------> IN_CONTROL --------------------------> CONTROL_LOST
        ^                  |      ^                                 |    |
        +------- close ----+      +--- synchronized: takes control -+    |
        +------- close --------------------------------------------------+

Three connections exist at most: one for commands, one for status (:class:`StatusConnection`), and one
for a stop, which takes over the status connection if that is idle. LinuxCNC gives control to the
client that asked for it last. A stop therefore takes control away from the command connection, and
the next command takes it back. Which connection may send is decided by :class:`SendArbiter`.

Locks, outermost first: the order lock of the controller (one order at a time), the query lock of the
status connection (one status query at a time), the two locks of the arbiter.
"""

from __future__ import annotations

import asyncio
import logging
from enum import Enum, auto

from drivers.controllers.linuxcnc import startup
from drivers.controllers.linuxcnc.commands import CommandChannel, ControllerCommands, ErrorMessages
from drivers.controllers.linuxcnc.connection import Connection, SendArbiter
from drivers.controllers.linuxcnc.protocol import Address, Timeouts, loop_time
from drivers.controllers.linuxcnc.status_channel import StatusConnection
from drivers.controllers.linuxcnc.stop import stop_in_place
from drivers.errors import ConnectionLost
from drivers.interfaces import ControllerStatus
from drivers.wire_trace import TraceRecorder
from hexacell.errors import DeviceError

_log = logging.getLogger("drivers.controllers.linuxcnc")


class SessionState(Enum):
    """Whether the session is open, and whether its command connection has control."""

    CLOSED = auto()
    IN_CONTROL = auto()
    CONTROL_LOST = auto()


class Session:
    """The connections from ``open`` to ``close``; a broken one is replaced by ``synchronized``.

    Attributes:
        stop_count: how often ``stop`` was called; a waiting motion compares it.
    """

    def __init__(self, address: Address, timeouts: Timeouts, trace: TraceRecorder | None) -> None:
        self.stop_count = 0
        self._address = address
        self._timeouts = timeouts
        self._trace = trace
        self._state = SessionState.CLOSED
        self._channel = CommandChannel(self._connect)
        self._arbiter = SendArbiter()
        self._messages = ErrorMessages()
        self._status = StatusConnection(address, timeouts, self._arbiter, self._messages, trace)

    async def open(self) -> ControllerCommands:
        """Open the command connection; the session stays closed if that fails."""
        was_closed = self._state is SessionState.CLOSED
        if was_closed:
            self._state = SessionState.IN_CONTROL
        try:
            return await self.synchronized()
        except BaseException:
            if was_closed:
                self._state = SessionState.CLOSED
            raise

    async def synchronized(self) -> ControllerCommands:
        """The command connection, without an outstanding response, and in control.

        Raises:
            DeviceError: The session is closed, or no connection is possible.
        """
        self._require_open()
        await self._arbiter.stop_ended()
        before = self._channel.commands
        commands = await self._channel.synchronized()
        if commands is before and self._state is SessionState.CONTROL_LOST:
            await commands.connection.take_control()
        self._set_state(SessionState.IN_CONTROL)
        return commands

    async def in_control(self) -> ControllerCommands:
        """The command connection, after taking control in any case; older error messages are dropped."""
        self._set_state(SessionState.CONTROL_LOST)
        commands = await self.synchronized()
        await commands.errors()
        self._status.begin_disabled()
        return commands

    def machine_is_enabled(self) -> None:
        """The machine was seen enabled: what disables it from now on is an error."""
        self._status.begin_enabled()

    async def reconnect(self) -> ControllerCommands:
        """The command connection, as soon as a controller that may be restarting can be reached.

        Raises:
            ConnectionLost: It cannot be reached within ``timeouts.reconnect``.
        """
        deadline = loop_time() + self._timeouts.reconnect
        while True:
            try:
                return await self.synchronized()
            except ConnectionLost:
                if loop_time() > deadline:
                    raise
                await asyncio.sleep(self._timeouts.poll)

    async def status(self) -> ControllerStatus:
        """The machine's status, over a connection of its own: the other one may wait for a move.

        Raises:
            DeviceError: The session is closed, or the status cannot be read.
        """
        self._require_open()
        await self._arbiter.stop_ended()
        return await self._status.read()

    async def joints(self) -> tuple[float, ...] | None:
        """Where the joints are now, over the status connection; None before all are homed.

        Raises:
            DeviceError: The session is closed, or they cannot be read.
        """
        self._require_open()
        await self._arbiter.stop_ended()
        return await self._status.joints()

    async def stop(self, tolerance_mm: float) -> None:
        """Stop the motion over a connection of its own; no command is sent meanwhile.

        Raises:
            DeviceError: The machine could not be stopped, or that is unknown.
        """
        self.stop_count += 1
        _log.info("%s: stop", self._address.name)
        async with self._arbiter.stopping():
            try:
                ready = await self._status.release_connection()
                await stop_in_place(self._address, self._timeouts, tolerance_mm, self._trace, ready)
            finally:
                self._set_state(SessionState.CONTROL_LOST)

    async def close(self) -> None:
        """Close all connections; closing twice is harmless."""
        self._state = SessionState.CLOSED
        await self._status.close()
        await self._channel.close()

    async def _connect(self) -> ControllerCommands:
        async with self._arbiter.exclusive():
            connection = await Connection.open(self._address, self._timeouts, self._trace)
        connection.send_turn = self._arbiter.command_turn
        commands = ControllerCommands(connection, self._address, self._messages)
        try:
            await startup.acknowledge_on_completion(commands)
            self._require_open()  # it may have been closed meanwhile
        except BaseException:
            await connection.close()
            raise
        return commands

    def _set_state(self, state: SessionState) -> None:
        """Change the state of an open session; a closed one stays closed."""
        if self._state is not SessionState.CLOSED:
            self._state = state

    def _require_open(self) -> None:
        if self._state is SessionState.CLOSED:
            raise DeviceError("is not connected", subject=self._address.name, action="Open it first")
