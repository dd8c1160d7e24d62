"""What a client may ``set``, and what it takes to be allowed to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar

from drivers.simulated.linuxcnc.session import Context
from drivers.simulated.linuxcnc.state import Mode, Wait

Choice = TypeVar("Choice", Mode, Wait)


class Level(IntEnum):
    """Who is allowed to."""

    ANYBODY = 0
    COMMANDER = 1
    ON = 2
    """The commander, while the machine is on."""


@dataclass(frozen=True, slots=True)
class SetCommand:
    """A word after ``set``: who may say it, and what it does; false becomes NAK."""

    level: Level
    obey: Callable[[Context, str], bool]


def _echo(context: Context, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        context.echo = on
    return on is not None


def _verbose(context: Context, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        context.verbose = on
    return on is not None


def _enable(context: Context, argument: str) -> bool:
    if argument == context.access.enable_password:
        context.control.commander = context
        return True
    if argument.upper() == "OFF":
        context.control.commander = None
        return True
    return False


def _set_wait(context: Context, argument: str) -> bool:
    if (choice := _one_of(Wait, argument)) is None:
        return False
    context.control.answers = choice
    return True


def _estop(context: Context, argument: str) -> bool:
    on = _on_or_off(argument)
    return on is not None and context.control.set_estop(on=on)


def _machine(context: Context, argument: str) -> bool:
    on = _on_or_off(argument)
    return on is not None and context.control.set_machine(on=on)


def _mode(context: Context, argument: str) -> bool:
    mode = _one_of(Mode, argument)
    return mode is not None and context.control.set_mode(mode)


def _teleop_enable(context: Context, argument: str) -> bool:
    if (on := _on_or_off(argument)) is not None:
        context.control.teleop = on
    return on is not None


def _home(context: Context, argument: str) -> bool:
    return argument == "-1" and context.control.home()


def _mdi(context: Context, argument: str) -> bool:
    return context.control.mdi(argument)


def _abort(context: Context, _argument: str) -> bool:
    return context.control.abort()


def _on_or_off(argument: str) -> bool | None:
    return {"ON": True, "OFF": False}.get(argument.upper())


def _one_of(choices: type[Choice], argument: str) -> Choice | None:
    return next((choice for choice in choices if choice.value == argument.upper()), None)


ORDERS: dict[str, SetCommand] = {
    "ECHO": SetCommand(Level.ANYBODY, _echo),
    "VERBOSE": SetCommand(Level.ANYBODY, _verbose),
    "ENABLE": SetCommand(Level.ANYBODY, _enable),
    "SET_WAIT": SetCommand(Level.COMMANDER, _set_wait),
    "ESTOP": SetCommand(Level.COMMANDER, _estop),
    "MACHINE": SetCommand(Level.COMMANDER, _machine),
    "MODE": SetCommand(Level.ON, _mode),
    "TELEOP_ENABLE": SetCommand(Level.ON, _teleop_enable),
    "HOME": SetCommand(Level.ON, _home),
    "MDI": SetCommand(Level.ON, _mdi),
    "ABORT": SetCommand(Level.ON, _abort),
}
