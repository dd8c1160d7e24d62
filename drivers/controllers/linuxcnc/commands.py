"""The get and set commands of linuxcncrsh as typed calls; errors carry the controller's own messages."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress

from drivers.controllers.linuxcnc.connection import Connection
from drivers.controllers.linuxcnc.protocol import Response, parse_positions
from drivers.errors import CommandRefused, ConnectionLost
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose

_log = logging.getLogger("drivers.controllers.linuxcnc")

NO_REASON = "it is on, and gives no reason"
"""The reason of a refusal where nothing is known that keeps LinuxCNC from executing the command."""

_MAX_ERRORS = 100
_MAX_SHOWN = 4


class ErrorMessages:
    """The error messages of one machine, shared by the connections to it.

    LinuxCNC gives a message once, to the connection that asks first. The order that failed and the
    status both need it, so each has a list of those that it has not used yet.
    """

    def __init__(self) -> None:
        self.for_orders: list[str] = []
        self.for_status: list[str] = []
        self._reading = asyncio.Lock()

    async def read(self, next_message: Callable[[], Awaitable[str]]) -> None:
        """Empty the controller's queue; a message that another connection is reading is waited for."""
        async with self._reading:
            reading = asyncio.ensure_future(self._read_all(next_message))
            try:
                await asyncio.shield(reading)
            finally:
                while not reading.done():  # a cancelled caller waits too: the message would be lost
                    with suppress(asyncio.CancelledError):
                        await asyncio.wait([reading])

    async def _read_all(self, next_message: Callable[[], Awaitable[str]]) -> None:
        for _ in range(_MAX_ERRORS):
            if (text := await next_message()).upper() == "OK":
                break
            for unused in (self.for_orders, self.for_status):
                if text not in unused:
                    unused.append(text)
                del unused[:-_MAX_ERRORS]


class ControllerCommands:
    """Get and set commands over one connection."""

    def __init__(self, connection: Connection, messages: ErrorMessages | None = None) -> None:
        self.connection = connection
        self.subject = connection.subject
        self.unit_mm = connection.settings.unit_mm
        self.joint_unit_mm = connection.settings.joint_unit_mm
        self._messages = messages or ErrorMessages()

    async def get(self, what: str) -> str:
        """The text after ``WHAT``; raises ``CommandRefused`` if the server does not know ``what``."""
        response = await self._query(what)
        if not response.accepted:
            raise CommandRefused(f"'get {what}'", "it does not know that", subject=self.subject)
        return response.text

    async def get_if_known(self, what: str) -> str:
        """The text after ``WHAT``; empty if the server does not know ``what``."""
        return (await self._query(what)).text

    async def set(self, what: str, timeout_s: float | None = None) -> None:
        """Send a set command; its acknowledgement does not prove an effect.

        Raises:
            CommandRefused: It is refused; the reason is the controller's own.
        """
        response = await self.connection.request(f"set {what}", timeout_s)
        if response.accepted:
            return
        if (await self.get_if_known("enable")).upper() == "OFF":
            reason = "another client has taken control of it"
            action = "See that nobody else moves the robot, then prepare it again"
        else:
            reason, action = await self.reason(response.explanations), None
        refusal = CommandRefused(f"'set {what}'", reason, subject=self.subject, action=action)
        _log.warning("%s %s", self.subject, refusal.problem)
        raise refusal

    async def pose(self) -> Pose:
        """The actual pose, mm and deg, by the controller's own kinematics."""
        x, y, z, *angles = self.positions_in(await self.get("abs_act_pos"))
        return Pose(self.unit_mm * x, self.unit_mm * y, self.unit_mm * z, *angles)

    async def joints(self) -> tuple[float, ...]:
        """The six actual joint variables, mm or deg."""
        return tuple(self.joint_unit_mm * value for value in self.positions_in(await self.get("joint_pos")))

    async def all_homed(self) -> bool:
        """Whether every joint is homed."""
        homed = (await self.get("joint_homed")).upper().split()
        return bool(homed) and all(word == "YES" for word in homed)

    async def is_on(self, what: str) -> bool:
        """Whether ``estop`` or ``machine`` is on."""
        return (await self.get(what)).upper() == "ON"

    async def read_errors(self) -> None:
        """Have the controller's error messages in the list that all connections share."""
        await self._messages.read(lambda: self.get("error"))

    async def errors(self) -> list[str]:
        """The error messages that no order has used yet, oldest first.

        They may be older than the order: call this before an order whose errors matter.
        """
        await self.read_errors()
        found, self._messages.for_orders = self._messages.for_orders, []
        return found

    async def reason(self, explanations: tuple[str, ...] = ()) -> str:
        """Why a command had no effect: the controller's error messages, else its state."""
        messages = [*explanations, *await self.errors()]
        if len(messages) > _MAX_SHOWN:
            messages[_MAX_SHOWN:] = [f"and {len(messages) - _MAX_SHOWN} more"]
        if messages:
            return "; ".join(messages)
        if await self.is_on("estop"):
            return "it is in emergency stop"
        return NO_REASON if await self.is_on("machine") else "it is switched off"

    async def _query(self, what: str) -> Response:
        # Another program's client may garble our command. A query can be repeated
        # safely; a set command is left to the caller.
        response = await self.connection.request(f"get {what}")
        return response if response.accepted else await self.connection.request(f"get {what}")

    def positions_in(self, text: str) -> tuple[float, ...]:
        """Six numbers of an answer; raises ``DeviceError`` where it has none."""
        try:
            return parse_positions(text)
        except ValueError as error:
            raise self.error(str(error)) from error

    def error(self, problem: str, action: str | None = None) -> DeviceError:
        """The error for what the controller does, without a reaction of its own."""
        return self.connection.error(DeviceError, problem, action)


class CommandChannel:
    """A connection that is opened when it is needed, and replaced after it broke.

    ``commands`` is the current one, if there is one.
    """

    def __init__(self, connect: Callable[[], Awaitable[ControllerCommands]]) -> None:
        self.commands: ControllerCommands | None = None
        self._connect = connect

    async def synchronized(self) -> ControllerCommands:
        """The connection, without an outstanding response.

        Raises:
            DeviceError: No connection is possible.
        """
        if self.commands is not None:
            try:
                await self.commands.connection.collect_late_response()
            except ConnectionLost:
                await self.close()
        if self.commands is None:
            self.commands = await self._connect()
        return self.commands

    async def close(self) -> None:
        """Close the connection, if there is one."""
        commands, self.commands = self.commands, None
        if commands is not None:
            await commands.connection.close()
