"""From any state of LinuxCNC to one in which it accepts moves, and reloading; each step is verified.

An acknowledgement means only that a command arrived: ``set machine on`` in emergency stop and
``set mode mdi`` before homing are both acknowledged and both do nothing.
"""

import asyncio
from collections.abc import Callable

from drivers.controllers.linuxcnc.commands import NO_REASON, ControllerCommands
from drivers.controllers.linuxcnc.protocol import Timeouts, loop_time, parse_number
from drivers.errors import CommandRefused, MotionInterrupted
from drivers.interfaces import StartupAction

Stopped = Callable[[], bool]

_MODAL_ACTION = "Put it into RS274NGC_STARTUP_CODE, or send it in MDI"
_OFFSET_MM = 1e-6
_UNITS_MM = {"MM": 1.0, "CM": 10.0, "INCH": 25.4}
_MOST_REQUESTS = 2


async def acknowledge_on_completion(commands: ControllerCommands) -> None:
    """Have commands acknowledged when they are completed, not when they are received.

    A permanent setting of the server in 2.9; one of the connection in 2.10, called ``wait_mode``.
    """
    try:
        await commands.set("set_wait done")
    except CommandRefused:
        await commands.set("wait_mode done")


async def next_action(commands: ControllerCommands) -> StartupAction | None:
    """The next action that it needs before it can move; None if it is ready.

    LinuxCNC starts in emergency stop and not homed. A later emergency stop leaves the joints homed.
    """
    if await commands.is_on("estop"):
        is_later = await commands.all_homed()
        return StartupAction.RESET_ESTOP if is_later else StartupAction.RESET_INITIAL_ESTOP
    if not await commands.is_on("machine"):
        return StartupAction.SWITCH_ON
    return None if await commands.all_homed() else StartupAction.HOME


async def leave_emergency_stop(commands: ControllerCommands, timeouts: Timeouts) -> None:
    """Reset the emergency stop.

    Raises:
        DeviceError: It stays on, for example because a switch is still pressed.
    """
    await commands.set("estop off", timeouts.command)
    if not await _becomes(commands, "estop", "OFF", timeouts):
        problem = f"stays in emergency stop: {await commands.reason()}"
        raise commands.error(problem, "Release the emergency stop at the machine")


async def switch_machine(commands: ControllerCommands, timeouts: Timeouts, *, on: bool) -> None:
    """Switch the machine on or off.

    Asked for once more where nothing happens and LinuxCNC gives no reason: on a starved computer it loses
    what its task asks of its motion.

    Raises:
        DeviceError: Its state does not change.
    """
    state, errors = "on" if on else "off", list[str]()
    for _ in range(_MOST_REQUESTS):
        await commands.set(f"machine {state}", timeouts.command)
        if await _becomes(commands, "machine", state.upper(), timeouts):
            return
        if errors := await commands.errors():
            break
    problem = f"does not switch {state}: {await commands.reason(tuple(errors))}"
    raise commands.error(problem, "Look for a message on the controller's own screen")


async def home_joints(
    commands: ControllerCommands, timeout_s: float, poll_s: float, stopped: Stopped
) -> None:
    """Home all joints that are not homed; the machine moves.

    LinuxCNC homes in joint mode only; after an earlier homing it is in teleoperation mode.

    Raises:
        MotionInterrupted: ``stopped`` became true.
        DeviceError: Some joint is not homed in time.
    """
    await commands.set("mode manual", timeout_s)
    if (await commands.get_if_known("teleop_enable")).upper() in ("YES", "ON"):
        await commands.set("teleop_enable off", timeout_s)
    await commands.errors()
    _raise_if_stopped(stopped, commands)
    await commands.set("home -1", timeout_s)
    deadline = loop_time() + timeout_s
    while not await commands.all_homed():
        _raise_if_stopped(stopped, commands)
        if loop_time() > deadline:
            problem = f"is not homed after {timeout_s:g} s: {await commands.reason()}"
            raise commands.error(problem, "Home it at the machine")
        await asyncio.sleep(poll_s)


async def restore_modes(commands: ControllerCommands, block: str, timeouts: Timeouts) -> None:
    """Execute a block that changes modes and moves nothing.

    Again where it is refused without a reason, as by LinuxCNC on a starved computer. A move must not be
    repeated so: a person may have stopped it.

    Raises:
        CommandRefused: It is refused.
    """
    deadline = loop_time() + timeouts.command
    while True:
        try:
            await commands.set(f"mdi {block}")
        except CommandRefused as refusal:
            if refusal.reason != NO_REASON or loop_time() > deadline:
                raise
            await asyncio.sleep(timeouts.poll)
        else:
            return


async def enter_mdi_mode(commands: ControllerCommands, timeouts: Timeouts) -> None:
    """Enter MDI mode, in which single blocks are executed.

    What is asked for while homing ends may be acknowledged without effect, so it is asked for again.

    Raises:
        DeviceError: It stays in another mode.
    """
    for _ in range(_MOST_REQUESTS):
        await commands.set("mode mdi", timeouts.command)
        if await _becomes(commands, "mode", "MDI", timeouts):
            return
    raise commands.error(f"does not enter MDI mode: {await commands.reason()}")


async def check_coordinate_system(commands: ControllerCommands) -> str:
    """Check that ``G21 X1`` means 1 mm in machine coordinates, and a duration what it says.

    Gives the modal codes, empty where the server does not know them.

    Raises:
        DeviceError: It counts in another unit than the cell file says; or relative moves, a tool length, an
            offset or a feed override is active.
    """
    units = (await commands.get_if_known("user_linear_units")).upper()
    if units and (unit_mm := _UNITS_MM.get(units)) != commands.unit_mm:
        own = "Set [TRAJ] LINEAR_UNITS = mm in its INI file"
        action = f"Set controller.unit_mm = {unit_mm:g}" if unit_mm else own
        raise commands.error(
            f"counts in {units.lower()}, controller.unit_mm is {commands.unit_mm:g}", action
        )
    text = await commands.get_if_known("program_codes")
    if "G91" in (codes := text.upper().split()):
        raise commands.error("takes coordinates as relative (G91)", f"G90 is needed. {_MODAL_ACTION}")
    if "G43" in codes:
        raise commands.error("adds a tool length (G43)", f"G49 is needed. {_MODAL_ACTION}")
    offset = await commands.get_if_known("pos_offset")
    if offset and any(abs(value) > _OFFSET_MM for value in commands.positions_in(offset)):
        action = "Clear it: G10 L2 P1 X0 Y0 Z0 A0 B0 C0 and G92.1 in MDI"
        raise commands.error(f"adds an offset of {offset} to every coordinate (G54, G92)", action)
    percent = await commands.get_if_known("feed_override")
    if percent and parse_number(percent) > 100.0:
        problem = f"moves {percent} % as fast as it is commanded (feed override)"
        raise commands.error(problem, "Set the feed override to 100 % or less")
    return text


def _raise_if_stopped(stopped: Stopped, commands: ControllerCommands) -> None:
    if stopped():
        raise MotionInterrupted("was stopped before it was ready", subject=commands.subject)


async def _becomes(commands: ControllerCommands, what: str, state: str, timeouts: Timeouts) -> bool:
    """Whether the answer to a query is this state before the time for a switch is over."""
    deadline = loop_time() + timeouts.switch
    while (await commands.get(what)).upper() != state:
        if loop_time() > deadline:
            return False
        await asyncio.sleep(timeouts.poll)
    return True
