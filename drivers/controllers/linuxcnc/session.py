"""The session with one linuxcncrsh server: its connections, and who has control of the machine.

::

                 open                    stop, or in_control
      CLOSED -----------> IN_CONTROL --------------------------> CONTROL_LOST
        ^                  |      ^                                 |    |
        +------- close ----+      +--- synchronized: takes control -+    |
        +------- close --------------------------------------------------+

Three connections exist at most: one for commands, one for status, and one for a stop, which takes over
the status connection if that is idle. LinuxCNC gives control to the client that asked for it last. A stop
therefore takes control away from the command connection, and the next command takes it back. Which
connection may send is decided by :class:`SendArbiter`.

Locks, outermost first: the order lock of the controller (one order at a time), the query lock of the
status connection (one status query at a time), the two locks of the arbiter.
"""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext, suppress
from dataclasses import replace
from enum import Enum, auto
from functools import partial

from drivers.controllers.linuxcnc import startup
from drivers.controllers.linuxcnc.commands import CommandChannel, ControllerCommands, ErrorMessages
from drivers.controllers.linuxcnc.connection import Connection, SendArbiter
from drivers.controllers.linuxcnc.protocol import Timeouts, loop_time, subject_of
from drivers.errors import ConnectionLost
from drivers.interfaces import ControllerStatus
from drivers.wire_trace import TraceRecorder
from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError

_log = logging.getLogger("drivers.controllers.linuxcnc")

_RELEASE_TIMEOUT_S = 0.05
"""Longest wait of a stop for a status query in progress; it is answered within a millisecond."""

_QUICK_TIMEOUT_S = 0.3
"""Longest wait of a stop for a response over an existing connection; then a new one is opened."""

_STOP_ATTEMPTS = 3
_EQUAL_POSITIONS = 3
"""Successive joint positions that must agree before the machine is considered at standstill."""


class SessionState(Enum):
    """Whether the session is open, and whether its command connection has control."""

    CLOSED = auto()
    IN_CONTROL = auto()
    CONTROL_LOST = auto()


class Session:
    """The connections from ``open`` to ``close``; a broken one is replaced by ``synchronized``.

    Attributes:
        stop_count: how often ``stop`` was called; a waiting motion compares it.
        was_enabled: the machine was seen enabled: what disables it from now on is an error.
    """

    def __init__(
        self, settings: ControllerSettings, timeouts: Timeouts, trace: TraceRecorder | None
    ) -> None:
        self.stop_count = 0
        self.was_enabled = False
        self._settings, self._subject = settings, subject_of(settings)
        self._timeouts = timeouts
        self._trace = trace
        self._state = SessionState.CLOSED
        self._channel = CommandChannel(partial(self._connect, commanding=True))
        self._querying = CommandChannel(partial(self._connect, commanding=False))
        self._query = asyncio.Lock()
        self._arbiter = SendArbiter()
        self._messages = ErrorMessages()

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
        self.was_enabled, self._messages.for_status = False, []
        return commands

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

        Error messages are reported of a machine that was enabled and became disabled, those that an order
        read included. Those of a machine that was never enabled are left to the order that enables it.

        Raises:
            DeviceError: The session is closed, or the status cannot be read.
        """
        async with self._status_query() as commands:
            known = len(self._messages.for_status)
            # In this order: an emergency stop between the two is not taken for a machine that was
            # switched off.
            enabled, estop = await commands.is_on("machine"), await commands.is_on("estop")
            heartbeat = await commands.get("joint_pos")
            if enabled and not estop:
                self.was_enabled = True
                # An order may have read the message of a machine that was disabled since it answered.
                del self._messages.for_status[:known]
            elif self.was_enabled:
                await commands.read_errors()
                return ControllerStatus(estop, enabled, tuple(self._messages.for_status), heartbeat)
            return ControllerStatus(estop, enabled, heartbeat=heartbeat)

    async def joints(self) -> tuple[float, ...] | None:
        """Where the joints are now, over the status connection; None before all are homed.

        Raises:
            DeviceError: The session is closed, or they cannot be read.
        """
        async with self._status_query() as commands:
            return await commands.joints() if await commands.all_homed() else None

    async def stop(self, tolerance_mm: float) -> None:
        """Send abort over a connection of its own until successive joint positions agree.

        No command is sent meanwhile. The status connection, if it is idle, saves the time to open one.

        Raises:
            DeviceError: The machine cannot be reached, or still moves after ``timeouts.stop``.
        """
        self.stop_count += 1
        name, limit_s, action = self._subject, self._timeouts.stop, "Press the emergency stop"
        _log.info("%s: stop", name)
        async with self._arbiter.stop:
            try:
                ready = await self._released_status_connection()
                async with asyncio.timeout(limit_s):
                    if ready is None or not await self._stopped_over(ready, tolerance_mm):
                        await self._try_to_stop(tolerance_mm)
            except TimeoutError:
                problem = f"still moves {limit_s:g} s after the stop command"
                raise DeviceError(problem, subject=name, action=action) from None
            except DeviceError as error:
                problem = f"could not be stopped: it {error.problem}"
                raise DeviceError(problem, subject=name, action=action) from error
            finally:
                self._set_state(SessionState.CONTROL_LOST)

    async def close(self) -> None:
        """Close all connections; closing twice is harmless."""
        self._state = SessionState.CLOSED
        await self._querying.close()
        await self._channel.close()

    async def _connect(self, *, commanding: bool) -> ControllerCommands:
        """A connection, without control if it is for queries, which do not need that."""
        async with self._arbiter.line:
            to = self._settings, self._timeouts, self._trace
            connection = await Connection.open(*to, commanding=commanding)
        connection.send_turn = self._arbiter.command_turn if commanding else self._arbiter.query_turn
        commands = ControllerCommands(connection, self._messages)
        try:
            if commanding:
                await startup.acknowledge_on_completion(commands)
            self._require_open()  # it may have been closed meanwhile
        except BaseException:
            await connection.close()
            raise
        return commands

    @asynccontextmanager
    async def _status_query(self) -> AsyncIterator[ControllerCommands]:
        """One status query at a time; a connection that breaks is replaced at the next one."""
        self._require_open()
        await self._arbiter.stop_ended()
        async with self._query:
            commands = await self._querying.synchronized()
            try:
                yield commands
            except ConnectionLost:
                await self._querying.close()
                raise

    async def _released_status_connection(self) -> Connection | None:
        """Give the status connection away for a stop; None if a query occupies it for too long."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_RELEASE_TIMEOUT_S), self._query:
                commands, self._querying.commands = self._querying.commands, None
                if commands is not None:
                    commands.connection.send_turn = nullcontext
                    return commands.connection
        return None

    async def _stopped_over(self, ready: Connection, tolerance_mm: float) -> bool:
        try:
            await ready.take_control(_QUICK_TIMEOUT_S)
            await ready.request("set abort", _QUICK_TIMEOUT_S)
            return await self._is_at_standstill(ControllerCommands(ready), tolerance_mm)
        except DeviceError:
            return False
        finally:
            await ready.close()

    async def _try_to_stop(self, tolerance_mm: float) -> None:
        """Repeat after any error: another program's client may have garbled the command.

        A server that does not answer is given up earlier than one whose machine still moves, so that the
        error says which.
        """
        answer_s = min(self._timeouts.answer, self._timeouts.stop / (_STOP_ATTEMPTS + 1))
        timeouts = replace(self._timeouts, answer=answer_s)
        for attempt in range(1, _STOP_ATTEMPTS + 1):
            try:
                connection = await Connection.open(self._settings, timeouts, self._trace)
                try:
                    # Refused while the machine is off, which is fine, or after another client took
                    # control. Repeated, as the first one may precede the motion.
                    await connection.request("set abort")
                    while not await self._is_at_standstill(ControllerCommands(connection), tolerance_mm):
                        await connection.take_control()
                        await connection.request("set abort")
                finally:
                    await connection.close()
            except DeviceError:
                if attempt == _STOP_ATTEMPTS:
                    raise
            else:
                return

    async def _is_at_standstill(self, commands: ControllerCommands, tolerance_mm: float) -> bool:
        # Joints, and not the pose: where the forward kinematics fails, that stands still while they move.
        first = await commands.joints()
        for _ in range(_EQUAL_POSITIONS - 1):
            await asyncio.sleep(self._timeouts.poll)
            now = await commands.joints()
            if max(abs(new - old) for new, old in zip(now, first, strict=True)) > tolerance_mm:
                return False
        return True

    def _set_state(self, state: SessionState) -> None:
        """Change the state of an open session; a closed one stays closed."""
        if self._state is not SessionState.CLOSED:
            self._state = state

    def _require_open(self) -> None:
        if self._state is SessionState.CLOSED:
            raise DeviceError("is not connected", subject=self._subject, action="Open it first")
