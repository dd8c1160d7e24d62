"""The commands of a client of the simulated controller: all may ``get``, the one in control may ``set``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import TypeVar

from drivers.simulated.linuxcnc.state import ControllerState, TaskMode, WaitMode
from hexacell.cell.controller import ControllerSettings


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
        return self.state.commander is self


UNITS = {1.0: "MM", 10.0: "CM", 25.4: "INCH"}


def _switch(is_on: bool) -> str:
    return "ON" if is_on else "OFF"


def _answer(is_so: bool) -> str:
    return "YES" if is_so else "NO"


def _numbers(values: Iterable[float], unit: float = 1.0) -> str:
    """Lengths in the machine's unit; angles come with unit 1."""
    return " ".join(f"{value / unit:.6f}" for value in values)


def _position(session: ClientSession, values: tuple[float, ...]) -> str:
    """Three lengths in the machine's unit, and three angles."""
    return f"{_numbers(values[:3], session.settings.unit_mm)} {_numbers(values[3:])}"


GET_COMMANDS: dict[str, Callable[[ClientSession], str]] = {
    "ECHO": lambda session: _switch(session.echo),
    "VERBOSE": lambda session: _switch(session.verbose),
    "ENABLE": lambda session: _switch(session.has_control),
    "SET_WAIT": lambda session: session.state.wait_mode.value,
    "ESTOP": lambda session: _switch(session.state.estop),
    "MACHINE": lambda session: _switch(session.state.enabled),
    "MODE": lambda session: session.state.mode.value,
    "ERROR": lambda session: session.state.next_error(),
    "TELEOP_ENABLE": lambda session: _answer(session.state.teleop),
    "JOINT_HOMED": lambda session: " ".join([_answer(session.state.homed)] * 6),
    "JOINT_POS": lambda session: _numbers(session.state.machine.joints(), session.settings.joint_unit_mm),
    "ABS_ACT_POS": lambda session: _position(session, session.state.machine.pose().as_tuple()),
    "POS_OFFSET": lambda session: _position(session, session.state.modes.offsets),
    "PROGRAM_CODES": lambda session: session.state.modes.codes,
    "FEED_OVERRIDE": lambda session: f"{session.state.feed_override_percent:g}",
    "PROGRAM_UNITS": lambda _session: "MM",
    "USER_LINEAR_UNITS": lambda session: UNITS.get(session.settings.unit_mm, "CUSTOM"),
    "INIFILE": lambda session: Path(session.settings.config).name,
    "PLAT": lambda _session: "Linux",
}
OF_SERVER = frozenset({"ECHO", "VERBOSE", "ENABLE", "SET_WAIT"})
"""What the server answers by itself, whatever the controller does."""


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


SettingT = TypeVar("SettingT")


def _one_of(
    settings: Mapping[str, SettingT], change: Callable[[ClientSession, SettingT], None]
) -> Callable[[ClientSession, str], bool]:
    """The effect of a command whose argument is one of some words."""

    def execute(session: ClientSession, argument: str) -> bool:
        word = argument.upper()
        if word in settings:
            change(session, settings[word])
        return word in settings

    return execute


def _enable(session: ClientSession, argument: str) -> bool:
    if argument == session.settings.enable_password.get_secret_value():
        session.state.commander = session
        return True
    if argument.upper() == "OFF":
        session.state.commander = None
        return True
    return False


def _abort(session: ClientSession, _argument: str) -> bool:
    session.state.abort()
    return True


_SWITCH = {"ON": True, "OFF": False}
_TASK_MODES = {mode.value: mode for mode in TaskMode}
_WAIT_MODES = {mode.value: mode for mode in WaitMode}

SET_COMMANDS: dict[str, SetCommand] = {
    "ECHO": SetCommand(Permission.ANYBODY, _one_of(_SWITCH, lambda it, on: setattr(it, "echo", on))),
    "VERBOSE": SetCommand(Permission.ANYBODY, _one_of(_SWITCH, lambda it, on: setattr(it, "verbose", on))),
    "ENABLE": SetCommand(Permission.ANYBODY, _enable),
    "SET_WAIT": SetCommand(
        Permission.COMMANDER, _one_of(_WAIT_MODES, lambda one, mode: setattr(one.state, "wait_mode", mode))
    ),
    "ESTOP": SetCommand(Permission.COMMANDER, _one_of(_SWITCH, lambda one, on: one.state.set_estop(on=on))),
    "MACHINE": SetCommand(
        Permission.COMMANDER, _one_of(_SWITCH, lambda one, on: one.state.set_machine(on=on))
    ),
    "MODE": SetCommand(Permission.ON, _one_of(_TASK_MODES, lambda one, mode: one.state.set_mode(mode))),
    "TELEOP_ENABLE": SetCommand(
        Permission.ON, _one_of(_SWITCH, lambda one, on: setattr(one.state, "teleop", on))
    ),
    "HOME": SetCommand(Permission.ON, _one_of({"-1": -1}, lambda one, _joints: one.state.home())),
    "MDI": SetCommand(Permission.ON, lambda one, block: one.state.mdi(block)),
    "ABORT": SetCommand(Permission.ON, _abort),
}
