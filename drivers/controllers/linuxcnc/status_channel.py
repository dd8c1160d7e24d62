"""A second connection that looks on while the first one waits for a move, and stops it if need be."""

from __future__ import annotations

import asyncio

from drivers.controllers.errors import ConnectionLost
from drivers.controllers.linuxcnc.commands import ControllerCommands
from drivers.controllers.linuxcnc.connection import Connection
from drivers.controllers.linuxcnc.send_arbiter import SendArbiter
from drivers.controllers.linuxcnc.settings import Address, Timeouts
from drivers.interfaces import ControllerStatus
from drivers.wire_trace import TraceRecorder

HANDOVER_S = 0.05
"""Longest wait for a question that is being asked; an answer takes a millisecond."""


class StatusConnection:
    """Asks how the machine is; it takes control from nobody, for questions need none.

    Complaints are asked for only of a machine that was seen on and no longer is, for whoever asks takes
    them out of the queue. ``forget`` begins anew: somebody is about to switch it on.
    """

    def __init__(
        self, address: Address, patience: Timeouts, floor: SendArbiter, trace: TraceRecorder | None
    ) -> None:
        self._address = address
        self._patience = patience
        self._floor = floor
        self._trace = trace
        self._commands: ControllerCommands | None = None
        self._complaints: tuple[str, ...] = ()
        self._was_on = False
        self._turn = asyncio.Lock()

    async def status(self) -> ControllerStatus:
        """How the machine is now.

        Raises:
            DeviceError: It cannot be asked.
        """
        async with self._turn:
            commands = await self._in_step()
            try:
                return await self._asked(commands)
            except ConnectionLost:
                await self._drop()
                raise

    def reset_complaints(self) -> None:
        """Leave complaints to whoever switches it on now."""
        self._was_on, self._complaints = False, ()

    async def hand_over(self) -> Connection | None:
        """The connection, for stopping; none if it is not to be had at once."""
        try:
            async with asyncio.timeout(HANDOVER_S):
                await self._turn.acquire()
        except TimeoutError:
            return None
        try:
            commands, self._commands = self._commands, None
        finally:
            self._turn.release()
        if commands is None:
            return None
        commands.connection.floor = SendArbiter()  # a stop waits for nobody
        return commands.connection

    async def close(self) -> None:
        """Let the line go; closing twice is harmless."""
        await self._drop()

    async def _asked(self, commands: ControllerCommands) -> ControllerStatus:
        estop, enabled = await commands.is_on("estop"), await commands.is_on("machine")
        if enabled and not estop:
            self._was_on, self._complaints = True, ()
        elif self._was_on:
            self._complaints += tuple(await commands.errors())
        return ControllerStatus(estop, enabled, self._complaints)

    async def _in_step(self) -> ControllerCommands:
        if self._commands is not None:
            try:
                await self._commands.connection.collect_late_response()
            except ConnectionLost:
                await self._drop()
        if self._commands is None:
            async with self._floor.kept():
                connection = await Connection.open(
                    self._address, self._patience, self._trace, commanding=False
                )
            connection.floor = self._floor
            self._commands = ControllerCommands(connection, self._address.name)
        return self._commands

    async def _drop(self) -> None:
        commands, self._commands = self._commands, None
        if commands is not None:
            await commands.connection.close()
