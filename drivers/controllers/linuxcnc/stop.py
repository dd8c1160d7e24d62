"""Stopping a machine whose own connection is busy, and making sure that it stands."""

from __future__ import annotations

import asyncio

from drivers.controllers.linuxcnc.commands import ControllerCommands
from drivers.controllers.linuxcnc.connection import Connection
from drivers.controllers.linuxcnc.protocol import pose_difference
from drivers.controllers.linuxcnc.settings import Address, Timeouts
from drivers.wire_trace import TraceRecorder
from hexacell.errors import DeviceError

_ATTEMPTS = 3
_ALIKE = 3
"""Successive positions that must agree before the machine counts as standing."""

_PROMPT_S = 0.3
"""Longest wait for an answer over a connection that was open already; a new one is tried then."""


async def stop_in_place(
    address: Address,
    patience: Timeouts,
    tolerance_mm: float,
    recorder: TraceRecorder | None = None,
    ready: Connection | None = None,
) -> None:
    """Abort over a connection of its own until successive positions agree within ``tolerance_mm``.

    A connection that is ``ready`` spares the time of opening one; it is closed in the end.

    Raises:
        DeviceError: There is no way to it, or it still moves after ``patience.stop``.
    """
    try:
        async with asyncio.timeout(patience.stop):
            if ready is None or not await _stopped_at_once(ready, address, patience, tolerance_mm):
                await _try_to_stop(address, patience, tolerance_mm, recorder)
    except TimeoutError:
        problem = f"does not stand still {patience.stop:g} s after it was told to stop"
        raise _unstopped(problem, address) from None
    except DeviceError as error:
        raise _unstopped(f"could not be stopped: it {error.problem}", address) from error


async def _stopped_at_once(
    ready: Connection, address: Address, patience: Timeouts, tolerance_mm: float
) -> bool:
    try:
        await ready.take_control(_PROMPT_S)
        await ready.ask("set abort", _PROMPT_S)
        return await _stands(ControllerCommands(ready, address.name), patience.poll, tolerance_mm)
    except DeviceError:
        return False
    finally:
        await ready.close()


async def _try_to_stop(
    address: Address, patience: Timeouts, tolerance_mm: float, recorder: TraceRecorder | None
) -> None:
    """Try again whatever went wrong: commands of two clients that coincide garble each other."""
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            connection = await Connection.open(address, patience, recorder)
            try:
                await _abort_until_still(
                    ControllerCommands(connection, address.name), patience, tolerance_mm
                )
            finally:
                await connection.close()
        except DeviceError:
            if attempt == _ATTEMPTS:
                raise
        else:
            return


async def _abort_until_still(commands: ControllerCommands, patience: Timeouts, tolerance_mm: float) -> None:
    """One abort may come before the motion that it is meant for, or without having control."""
    while True:
        # Refused when the machine is off, which is as good, or when another client took control.
        await commands.connection.ask("set abort")
        if await _stands(commands, patience.poll, tolerance_mm):
            return
        await commands.connection.take_control()


async def _stands(commands: ControllerCommands, poll_s: float, tolerance_mm: float) -> bool:
    first = await commands.pose()
    for _ in range(_ALIKE - 1):
        await asyncio.sleep(poll_s)
        if max(pose_difference(first, await commands.pose())) > tolerance_mm:
            return False
    return True


def _unstopped(problem: str, address: Address) -> DeviceError:
    return DeviceError(problem, subject=address.name, action="Press the emergency stop")
