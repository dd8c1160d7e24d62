"""What third parties add through entry points: found by name, imported only when asked for."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from enum import StrEnum
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from hexacell.errors import UsageError, did_you_mean

Factory = Callable[..., Any]
_log = logging.getLogger(__name__)


class Group(StrEnum):
    """A kind of plug-in: the entry point group that packages announce theirs in."""

    GAUGES = "hexacell.gauges"
    ENCODERS = "hexacell.encoders"
    CONTROLLERS = "hexacell.controllers"
    THERMOMETERS = "hexacell.thermometers"
    CONFIG_FORMATS = "hexacell.config_formats"
    MECHANISMS = "hexacell.mechanisms"

    @property
    def noun(self) -> str:
        """What one of the group is called in a sentence."""
        return _NOUNS[self]


_NOUNS = {
    Group.GAUGES: "gauge protocol",
    Group.ENCODERS: "encoder protocol",
    Group.CONTROLLERS: "controller protocol",
    Group.THERMOMETERS: "thermometer protocol",
    Group.CONFIG_FORMATS: "config format",
    Group.MECHANISMS: "mechanism",
}


def names(group: Group) -> tuple[str, ...]:
    """The names of everything announced in ``group``, sorted. Nothing is imported."""
    return tuple(sorted(entry_points(group=group).names))


def load(group: Group, name: str) -> Factory:
    """Import the class, or whatever else makes one, that is announced as ``name`` in ``group``.

    Raises:
        UsageError: nothing has that name, or two packages claim it, or its import fails or gives
            nothing that can be called.
    """
    return _import(group, _only(group, name))


def load_all(group: Group) -> dict[str, Factory]:
    """Import everything announced in ``group``, by name.

    What cannot be imported is left out, with a warning in this module's log.
    """
    loaded = {}
    for name in names(group):
        try:
            loaded[name] = load(group, name)
        except UsageError as error:
            _log.warning("left out: %s", error)
    return loaded


def _only(group: Group, name: str) -> EntryPoint:
    by_target = {point.value: point for point in entry_points(group=group, name=name)}
    if not by_target:
        raise _unknown(group, name)
    found = list(by_target.values())
    if len(found) > 1:
        raise UsageError(
            f"{group.noun} '{name}' is offered more than once, by {_packages(found)}",
            action="Uninstall all but one",
        )
    return found[0]


def _unknown(group: Group, name: str) -> UsageError:
    known = names(group)
    action = did_you_mean(name, known) or f"Known are: {', '.join(known) or 'none'}"
    return UsageError(f"there is no {group.noun} '{name}'", action=action)


def _import(group: Group, point: EntryPoint) -> Factory:
    try:
        factory: object = point.load()
    except Exception as error:  # a stranger's module may fail in any way
        raise _broken(group, point, repr(error)) from error
    if not callable(factory):
        raise _broken(group, point, f"{factory!r} cannot be called")
    return factory


def _broken(group: Group, point: EntryPoint, reason: str) -> UsageError:
    return UsageError(
        f"{group.noun} '{point.name}' cannot be loaded from {point.value}: {reason}",
        action=f"Repair or uninstall {_packages([point])}",
    )


def _packages(points: Sequence[EntryPoint]) -> str:
    return " and ".join(sorted(point.dist.name if point.dist else "an unknown package" for point in points))
