"""What a client may ``set``, and what it takes to be allowed to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

from drivers.simulated.linuxcnc.session import ClientSession
from drivers.simulated.linuxcnc.state import TaskMode, WaitMode

SettingT = TypeVar("SettingT", TaskMode, WaitMode)


class Permission(IntEnum):
    """Who is allowed to."""

    ANYBODY = 0
    COMMANDER = 1
    ON = 2
    """The commander, while the machine is on."""


@dataclass(frozen=True, slots=True)
class SetCommand:
    """A word after ``set``: who may say it, and what it does; false becomes NAK."""

    permission: Permission
    execute: Callable[[ClientSession, str], bool]


def _echo(context: ClientSession, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        context.echo = on
    return on is not None


def _verbose(context: ClientSession, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        context.verbose = on
    return on is not None


def _enable(context: ClientSession, argument: str) -> bool:
    if argument == context.access.enable_password:
        context.control.commander = context
        return True
    if argument.upper() == "OFF":
        context.control.commander = None
        return True
    return False


def _set_wait(context: ClientSession, argument: str) -> bool:
    if (choice := _one_of(WaitMode, argument)) is None:
        return False
    context.control.wait_mode = choice
    return True


def _estop(context: ClientSession, argument: str) -> bool:
    on = _on_or_off(argument)
    return on is not None and context.control.set_estop(on=on)


def _machine(context: ClientSession, argument: str) -> bool:
    on = _on_or_off(argument)
    return on is not None and context.control.set_machine(on=on)


def _mode(context: ClientSession, argument: str) -> bool:
    mode = _one_of(TaskMode, argument)
    return mode is not None and context.control.set_mode(mode)


def _teleop_enable(context: ClientSession, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        context.control.teleop = on
    return on is not None


def _home(context: ClientSession, argument: str) -> bool:
    return argument == "-1" and context.control.home()


def _mdi(context: ClientSession, argument: str) -> bool:
    return context.control.mdi(argument)


def _abort(context: ClientSession, _argument: str) -> bool:
    return context.control.abort()


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
