"""The commands of a client of the simulated controller: all may ``get``, the one in control may ``set``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import TypeVar

from drivers.simulated.linuxcnc.state import ControllerState, TaskMode, WaitMode
from hexacell.cell.devices import ControllerSettings


@dataclass(slots=True, eq=False)
class ClientSession:
    """The settings of one connection, and the state that all of them share."""

    state: ControllerState
    settings: ControllerSettings
    greeted: bool = False
    echo: bool = True
    verbose: bool = False

    @property
    def has_control(self) -> bool:
        """Whether this client has control."""
        return self.state.commander is self


_MODAL_CODES = "G0 G17 G40 G21 G90 G94 G54 G49 G99 G64 G97 G91.1 G8 G92.2 F0 S0"


def _on_off(*, on: bool) -> str:
    return "ON" if on else "OFF"


def _yes_no(*, yes: bool) -> str:
    return "YES" if yes else "NO"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.6f}" for value in values)


GET_COMMANDS: dict[str, Callable[[ClientSession], str]] = {
    "ENABLE": lambda session: _on_off(on=session.has_control),
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
    "USER_LINEAR_UNITS": lambda _session: "MM",
    "INIFILE": lambda session: Path(session.settings.config).name,
}


SettingT = TypeVar("SettingT", TaskMode, WaitMode)


class Permission(IntEnum):
    """Which client may send a command."""

    ANYBODY = 0
    COMMANDER = 1
    ON = 2
    """The client in control, while the machine is on."""


@dataclass(frozen=True, slots=True)
class SetCommand:
    """A command after ``set``: its permission and its effect; false becomes NAK."""

    permission: Permission
    execute: Callable[[ClientSession, str], bool]


def _echo(session: ClientSession, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        session.echo = on
    return on is not None


def _verbose(session: ClientSession, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        session.verbose = on
    return on is not None


def _enable(session: ClientSession, argument: str) -> bool:
    if argument == session.settings.enable_password:
        session.state.commander = session
        return True
    if argument.upper() == "OFF":
        session.state.commander = None
        return True
    return False


def _set_wait(session: ClientSession, argument: str) -> bool:
    if (choice := _one_of(WaitMode, argument)) is None:
        return False
    session.state.wait_mode = choice
    return True


def _estop(session: ClientSession, argument: str) -> bool:
    on = _on_or_off(argument)
    return on is not None and session.state.set_estop(on=on)


def _machine(session: ClientSession, argument: str) -> bool:
    on = _on_or_off(argument)
    return on is not None and session.state.set_machine(on=on)


def _mode(session: ClientSession, argument: str) -> bool:
    mode = _one_of(TaskMode, argument)
    return mode is not None and session.state.set_mode(mode)


def _teleop_enable(session: ClientSession, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        session.state.teleop = on
    return on is not None


def _home(session: ClientSession, argument: str) -> bool:
    return argument == "-1" and session.state.home()


def _mdi(session: ClientSession, argument: str) -> bool:
    return session.state.mdi(argument)


def _abort(session: ClientSession, _argument: str) -> bool:
    return session.state.abort()


def _on_or_off(argument: str) -> bool | None:
    return {"ON": True, "OFF": False}.get(argument.upper())


def _one_of(choices: type[SettingT], argument: str) -> SettingT | None:
    return next((choice for choice in choices if choice.value == argument.upper()), None)


SET_COMMANDS: dict[str, SetCommand] = {
    "ECHO": SetCommand(Permission.ANYBODY, _echo),
    "VERBOSE": SetCommand(Permission.ANYBODY, _verbose),
    "ENABLE": SetCommand(Permission.ANYBODY, _enable),
    "SET_WAIT": SetCommand(Permission.COMMANDER, _set_wait),
    "ESTOP": SetCommand(Permission.COMMANDER, _estop),
    "MACHINE": SetCommand(Permission.COMMANDER, _machine),
    "MODE": SetCommand(Permission.ON, _mode),
    "TELEOP_ENABLE": SetCommand(Permission.ON, _teleop_enable),
    "HOME": SetCommand(Permission.ON, _home),
    "MDI": SetCommand(Permission.ON, _mdi),
    "ABORT": SetCommand(Permission.ON, _abort),
}
