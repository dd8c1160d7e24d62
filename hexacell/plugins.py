"""Plug-ins that packages announce as entry points: found by name, imported only when needed."""

import logging
import sys
from collections.abc import Callable, Sequence
from enum import Enum
from functools import lru_cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from typing import Any

from hexacell.errors import UsageError, did_you_mean

_log = logging.getLogger(__name__)

Factory = Callable[..., Any]


class Group(Enum):
    """A kind of plug-in: the name of its entry point group, and the word for one plug-in in a message."""

    GAUGES = ("hexacell.gauges", "gauge protocol")
    SIMULATED_GAUGES = ("hexacell.simulated_gauges", "simulated gauge")
    ENCODERS = ("hexacell.encoders", "encoder protocol")
    CONTROLLERS = ("hexacell.controllers", "controller protocol")
    THERMOMETERS = ("hexacell.thermometers", "thermometer protocol")
    CONFIG_FORMATS = ("hexacell.config_formats", "config format")
    MECHANISMS = ("hexacell.mechanisms", "mechanism")

    def __init__(self, entry_points: str, noun: str) -> None:
        self.entry_points = entry_points
        self.noun = noun


def names(group: Group) -> tuple[str, ...]:
    """The names announced in ``group``, sorted. Nothing is imported."""
    return tuple(sorted(_announced(group, tuple(sys.path)).names))


def load(group: Group, name: str) -> Factory:
    """Import the class or factory that is announced as ``name`` in ``group``.

    Raises:
        UsageError: nothing has that name, two packages define it, its import fails, or it is not
            callable.
    """
    point = _only(group, name)
    try:
        factory: object = point.load()
    except Exception as error:  # third-party code may raise anything
        raise _broken(group, point, repr(error)) from error
    if not callable(factory):
        raise _broken(group, point, f"{factory!r} is not callable")
    _log.debug("%s '%s' is %s", group.noun, name, point.value)
    return factory


@lru_cache
def _announced(group: Group, path: tuple[str, ...]) -> EntryPoints:  # noqa: ARG001 - where packages are found
    """What all packages announce, read once: it takes milliseconds, and a cell names many plug-ins."""
    return entry_points(group=group.entry_points)


def _only(group: Group, name: str) -> EntryPoint:
    points = _announced(group, tuple(sys.path)).select(name=name)
    by_target = {point.value: point for point in points}
    if not by_target:
        known = names(group)
        action = did_you_mean(name, known) or f"Known are: {', '.join(known) or 'none'}"
        raise UsageError(f"there is no {group.noun} '{name}'", action=action)
    found = list(by_target.values())
    if len(found) > 1:
        raise UsageError(
            f"{group.noun} '{name}' is defined more than once, by {_packages(found)}",
            action="Uninstall all but one",
        )
    return found[0]


def _broken(group: Group, point: EntryPoint, reason: str) -> UsageError:
    return UsageError(
        f"{group.noun} '{point.name}' cannot be loaded from {point.value}: {reason}",
        action=f"Repair or uninstall {_packages([point])}",
    )


def _packages(points: Sequence[EntryPoint]) -> str:
    return " and ".join(sorted(point.dist.name if point.dist else "an unknown package" for point in points))
