"""Stopping the machine over a connection of its own, and verifying its standstill."""

from __future__ import annotations

import asyncio
from dataclasses import replace

from drivers.controllers.linuxcnc.commands import ControllerCommands
from drivers.controllers.linuxcnc.connection import Connection
from drivers.controllers.linuxcnc.protocol import Address, Timeouts
from drivers.wire_trace import TraceRecorder
from hexacell.errors import DeviceError

_ATTEMPTS = 3
_EQUAL_POSITIONS = 3
"""Successive joint positions that must agree before the machine is considered at standstill."""

_QUICK_TIMEOUT_S = 0.3
"""Longest wait for a response over an existing connection; then a new one is opened."""


async def stop_in_place(
    address: Address,
    timeouts: Timeouts,
    tolerance_mm: float,
    recorder: TraceRecorder | None = None,
    ready: Connection | None = None,
) -> None:
    """Send abort until successive joint positions agree within ``tolerance_mm``.

    A ``ready`` connection saves the time to open one; it is closed afterwards. A server that does not
    answer is given up earlier than one whose machine still moves, so that the error says which.

    Raises:
        DeviceError: It cannot be reached, or it still moves after ``timeouts.stop``.
    """
    timeouts = replace(timeouts, answer=min(timeouts.answer, timeouts.stop / (_ATTEMPTS + 1)))
    try:
        async with asyncio.timeout(timeouts.stop):
            if ready is None or not await _stopped_over(ready, address, timeouts, tolerance_mm):
                await _try_to_stop(address, timeouts, tolerance_mm, recorder)
    except TimeoutError:
        problem = f"still moves {timeouts.stop:g} s after the stop command"
        raise DeviceError(problem, subject=address.name, action="Press the emergency stop") from None
    except DeviceError as error:
        problem = f"could not be stopped: it {error.problem}"
        raise DeviceError(problem, subject=address.name, action="Press the emergency stop") from error


async def _stopped_over(
    ready: Connection, address: Address, timeouts: Timeouts, tolerance_mm: float
) -> bool:
    try:
        await ready.take_control(_QUICK_TIMEOUT_S)
        await ready.request("set abort", _QUICK_TIMEOUT_S)
        return await _is_at_standstill(ControllerCommands(ready, address), timeouts.poll, tolerance_mm)
    except DeviceError:
        return False
    finally:
        await ready.close()


async def _try_to_stop(
    address: Address, timeouts: Timeouts, tolerance_mm: float, recorder: TraceRecorder | None
) -> None:
    """Repeat after any error: another program's client may have garbled the command."""
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            connection = await Connection.open(address, timeouts, recorder)
            try:
                await _abort_until_still(ControllerCommands(connection, address), timeouts, tolerance_mm)
            finally:
                await connection.close()
        except DeviceError:
            if attempt == _ATTEMPTS:
                raise
        else:
            return


async def _abort_until_still(commands: ControllerCommands, timeouts: Timeouts, tolerance_mm: float) -> None:
    """Repeat the abort: the first one may precede the motion, or be sent without control."""
    while True:
        # Refused while the machine is off, which is fine, or after another client took control.
        await commands.connection.request("set abort")
        if await _is_at_standstill(commands, timeouts.poll, tolerance_mm):
            return
        await commands.connection.take_control()


async def _is_at_standstill(commands: ControllerCommands, poll_s: float, tolerance_mm: float) -> bool:
    # Joints, and not the pose: where the forward kinematics fails, that stands still while they move.
    first = await commands.joints()
    for _ in range(_EQUAL_POSITIONS - 1):
        await asyncio.sleep(poll_s)
        now = await commands.joints()
        if max(abs(new - old) for new, old in zip(now, first, strict=True)) > tolerance_mm:
            return False
    return True
