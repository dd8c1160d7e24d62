"""The ``get`` commands, permitted to every client, and their responses."""

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
    "ECHO": lambda session: _on_off(on=session.echo),
    "VERBOSE": lambda session: _on_off(on=session.verbose),
    "ENABLE": lambda session: _on_off(on=session.has_control),
    "SET_WAIT": lambda session: session.state.wait_mode.value,
    "ESTOP": lambda session: _on_off(on=session.state.estop),
    "MACHINE": lambda session: _on_off(on=session.state.enabled),
    "MODE": lambda session: session.state.mode.value,
    "ERROR": lambda session: session.state.next_error(),
    "TELEOP_ENABLE": lambda session: _yes_no(yes=session.state.teleop),
    "JOINT_HOMED": lambda session: " ".join([_yes_no(yes=session.state.homed)] * 6),
    "JOINT_POS": lambda session: _numbers(session.state.machine.joints()),
    "ABS_ACT_POS": lambda session: _numbers(session.state.machine.pose().as_tuple()),
    "POS_OFFSET": lambda _session: _numbers([0.0] * 6),
    "PROGRAM_CODES": lambda _session: _MODAL_CODES,
    "PROGRAM_UNITS": lambda _session: "MM",
    "USER_LINEAR_UNITS": lambda _session: "MM",
    "INIFILE": lambda session: session.settings.config,
    "PLAT": lambda _session: "Linux",
}
