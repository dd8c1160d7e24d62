"""What anybody may ``get``, greeted or not, and the words that answer it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from drivers.simulated.linuxcnc.session import ClientSession

_MODAL_CODES = "G0 G17 G40 G21 G90 G94 G54 G49 G99 G64 G97 G91.1 G8 G92.2 F0 S0"


def _on_off(*, on: bool) -> str:
    return "ON" if on else "OFF"


def _yes_no(*, yes: bool) -> str:
    return "YES" if yes else "NO"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.6f}" for value in values)


GET_COMMANDS: dict[str, Callable[[ClientSession], str]] = {
    "ECHO": lambda context: _on_off(on=context.echo),
    "VERBOSE": lambda context: _on_off(on=context.verbose),
    "ENABLE": lambda context: _on_off(on=context.has_control),
    "SET_WAIT": lambda context: context.control.wait_mode.value,
    "ESTOP": lambda context: _on_off(on=context.control.estop),
    "MACHINE": lambda context: _on_off(on=context.control.enabled),
    "MODE": lambda context: context.control.mode.value,
    "ERROR": lambda context: context.control.next_error(),
    "TELEOP_ENABLE": lambda context: _yes_no(yes=context.control.teleop),
    "JOINT_HOMED": lambda context: " ".join([_yes_no(yes=context.control.homed)] * 6),
    "JOINT_POS": lambda context: _numbers(context.control.machine.joints()),
    "ABS_ACT_POS": lambda context: _numbers(context.control.machine.pose().as_tuple()),
    "POS_OFFSET": lambda _context: _numbers([0.0] * 6),
    "PROGRAM_CODES": lambda _context: _MODAL_CODES,
    "PROGRAM_UNITS": lambda _context: "MM",
    "USER_LINEAR_UNITS": lambda _context: "MM",
    "INIFILE": lambda context: context.access.config,
    "PLAT": lambda _context: "Linux",
}
