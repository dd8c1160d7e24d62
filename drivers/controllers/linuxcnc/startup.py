"""From whatever state LinuxCNC is in to one in which it takes moves, each step verified.

An acknowledgement says that a command arrived: ``set machine on`` in emergency stop and
``set mode mdi`` before homing are both acknowledged and both do nothing.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from drivers.controllers.errors import CommandRefused, MotionInterrupted
from drivers.controllers.linuxcnc.commands import ControllerCommands
from drivers.controllers.linuxcnc.protocol import parse_positions
from drivers.controllers.linuxcnc.settings import Timeouts
from hexacell.errors import DeviceError

Stopped = Callable[[], bool]

_MODAL_ACTION = "Put it into RS274NGC_STARTUP_CODE, or send it in MDI"
_OFFSET_MM = 1e-6


async def acknowledge_on_completion(commands: ControllerCommands) -> None:
    """Let orders be answered when they are done rather than when they arrive.

    Global and lasting in 2.9, the connection's own in 2.10, which calls it ``wait_mode``.
    """
    try:
        await commands.set("set_wait done")
    except CommandRefused:
        await commands.set("wait_mode done")


async def leave_emergency_stop(commands: ControllerCommands, patience: Timeouts) -> None:
    """Reset the emergency stop if it is on.

    Raises:
        DeviceError: It stays on, because a switch is still pressed for instance.
    """
    if not await commands.is_on("estop"):
        return
    await commands.set("estop off")
    if not await _comes_true(lambda: _is(commands, "estop", on=False), patience):
        raise DeviceError(
            f"stays in emergency stop: {await commands.reason()}",
            subject=commands.subject,
            action="Release the emergency stop at the machine",
        )


async def switch_machine(commands: ControllerCommands, patience: Timeouts, *, on: bool) -> None:
    """Switch the machine on or off.

    Raises:
        DeviceError: It does not follow.
    """
    state = "on" if on else "off"
    await commands.set(f"machine {state}")
    if not await _comes_true(lambda: _is(commands, "machine", on=on), patience):
        raise DeviceError(
            f"does not switch {state}: {await commands.reason()}",
            subject=commands.subject,
            action="See what the controller's own screen says",
        )


async def home_joints(
    commands: ControllerCommands, patience_s: float, poll_s: float, stopped: Stopped
) -> None:
    """Home all joints that are not; the machine moves.

    LinuxCNC homes in joint mode only, and is in teleoperation once it has been homed before.

    Raises:
        MotionInterrupted: ``stopped`` came true.
        DeviceError: Some joint is not homed in time.
    """
    await commands.set("mode manual")
    if (await commands.get_if_known("teleop_enable")).upper() in ("YES", "ON"):
        await commands.set("teleop_enable off")
    await commands.errors()
    _go_on_unless(stopped, commands)
    await commands.set("home -1", patience_s)
    give_up = _now() + patience_s
    while not await commands.all_homed():
        _go_on_unless(stopped, commands)
        if _now() > give_up:
            problem = f"is not homed after {patience_s:g} s: {await commands.reason()}"
            raise DeviceError(problem, subject=commands.subject, action="Home it at the machine")
        await asyncio.sleep(poll_s)


async def enter_mdi_mode(commands: ControllerCommands, patience: Timeouts) -> None:
    """Enter the mode in which it takes single commands.

    Raises:
        DeviceError: It stays in another mode.
    """
    await commands.set("mode mdi")

    async def chosen() -> bool:
        return (await commands.get("mode")).upper() == "MDI"

    if not await _comes_true(chosen, patience):
        problem = f"does not enter MDI mode: {await commands.reason()}"
        raise DeviceError(problem, subject=commands.subject)


async def check_coordinate_system(commands: ControllerCommands) -> None:
    """Refuse units, offsets and modes under which ``G0 X1`` is not 1 mm in machine coordinates.

    Raises:
        DeviceError: Inches, relative moves, a tool length or an offset is active.
    """
    units = (await commands.get_if_known("user_linear_units")).upper()
    if units not in ("MM", ""):
        raise DeviceError(
            f"counts in {units.lower()}",
            subject=commands.subject,
            action="Set [TRAJ] LINEAR_UNITS = mm in its INI file",
        )
    codes = (await commands.get_if_known("program_codes")).upper().split()
    for wrong, meaning, right in (
        ("G20", "takes coordinates in inches", "G21"),
        ("G91", "takes coordinates as relative", "G90"),
        ("G43", "adds a tool length", "G49"),
    ):
        if wrong in codes:
            raise DeviceError(
                f"{meaning} ({wrong})",
                subject=commands.subject,
                action=f"{right} is needed. {_MODAL_ACTION}",
            )
    await _refuse_offsets(commands)


async def _refuse_offsets(commands: ControllerCommands) -> None:
    text = await commands.get_if_known("pos_offset")
    if text and any(abs(value) > _OFFSET_MM for value in parse_positions(text)):
        raise DeviceError(
            f"adds an offset of {text} to every coordinate (G54, G92)",
            subject=commands.subject,
            action="Clear it: G10 L2 P1 X0 Y0 Z0 A0 B0 C0 and G92.1 in MDI",
        )


def _go_on_unless(stopped: Stopped, commands: ControllerCommands) -> None:
    if stopped():
        raise MotionInterrupted("was stopped before it was ready", subject=commands.subject)


async def _is(commands: ControllerCommands, what: str, *, on: bool) -> bool:
    return await commands.is_on(what) is on


async def _comes_true(condition: Callable[[], Awaitable[bool]], patience: Timeouts) -> bool:
    give_up = _now() + patience.switch
    while not await condition():
        if _now() > give_up:
            return False
        await asyncio.sleep(patience.poll)
    return True


def _now() -> float:
    return asyncio.get_running_loop().time()
