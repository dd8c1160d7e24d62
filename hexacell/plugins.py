"""Plug-ins that packages announce as entry points: found by name, imported only when needed."""

import logging
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import Enum
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint, EntryPoints, entry_points
from typing import Any

from hexacell.errors import DeviceError, HexacellError, UsageError, did_you_mean

_log = logging.getLogger(__name__)

Factory = Callable[..., Any]
OWN = "hexacell"
"""The package of this program, whose errors are its own."""


class PluginFailed(DeviceError):
    """A plug-in is not what it must be, or raised what is its fault; ``subject`` is its package."""


class Group(Enum):
    """A kind of plug-in: the name of its entry point group, and the word for one plug-in in a message."""

    GAUGES = ("hexacell.gauges", "gauge protocol")
    SIMULATED_GAUGES = ("hexacell.simulated_gauges", "simulated gauge")
    ENCODERS = ("hexacell.encoders", "encoder protocol")
    CONTROLLERS = ("hexacell.controllers", "controller protocol")
    THERMOMETERS = ("hexacell.thermometers", "thermometer protocol")
    CONFIG_FORMATS = ("hexacell.config_formats", "config format")
    MECHANISMS = ("hexacell.mechanisms", "mechanism")
    TERMS = ("hexacell.terms", "term beside the geometry")

    def __init__(self, entry_points: str, noun: str) -> None:
        self.entry_points = entry_points
        self.noun = noun


def names(group: Group) -> tuple[str, ...]:
    """The names announced in ``group``, sorted. Nothing is imported."""
    return tuple(sorted(_announced(group, tuple(sys.path)).names))


def load(group: Group, name: str) -> Factory:
    """Import the class or factory that is announced as ``name`` in ``group``.

    Raises:
        UsageError: nothing has that name, or two packages define it.
        PluginFailed: its import fails, or it is not callable.
    """
    point = _only(group, name)
    try:
        factory: object = point.load()
    except Exception as error:  # third-party code may raise anything
        raise broken(group, name, repr(error)) from error
    if not callable(factory):
        raise broken(group, name, f"{factory!r} is not callable")
    _log.debug("%s '%s' is %s", group.noun, name, point.value)
    return factory


def created(group: Group, name: str, *arguments: object, **named: object) -> Any:  # noqa: ANN401
    """What the class or factory that is announced as ``name`` in ``group`` makes of the arguments.

    Raises:
        UsageError: as :func:`load` does.
        PluginFailed: as that does; or it takes no such arguments, or fails.
    """
    factory = load(group, name)
    with plugin_failures_named():
        try:
            return factory(*arguments, **named)
        except TypeError as error:  # perhaps in the call itself, of which nothing of the plug-in is a part
            package = _only(group, name).dist
            if package is None or package.name == OWN:
                raise
            raise _failed(package, getattr(factory, "__qualname__", name), error) from error


@contextmanager
def plugin_failures_named() -> Iterator[None]:
    """Convert whatever a plug-in of another package raises, within this context or decorated function.

    Raises:
        PluginFailed: with the package, its version and the method that was called.
    """
    try:
        yield
    except HexacellError:
        raise
    except Exception as error:
        if (failed := plugin_failure(error)) is None:
            raise
        raise failed from error


def plugin_failure(error: BaseException) -> PluginFailed | None:
    """An error as that of the plug-in it came through; None if it came through none of another package."""
    packages = _foreign(tuple(sys.path))
    for frame, _ in traceback.walk_tb(error.__traceback__):
        module = str(frame.f_globals.get("__name__"))
        if (package := packages.get(module.partition(".")[0])) is not None:
            return _failed(package, f"{module}.{frame.f_code.co_qualname}", error)
    return None if error.__cause__ is None else plugin_failure(error.__cause__)


def _failed(package: Distribution, method: str, error: BaseException) -> PluginFailed:
    _log.info("%s failed in %s", package.name, method, exc_info=error)
    words = " ".join(f"{type(error).__name__}: {error}".split())
    return PluginFailed(
        f"this plug-in failed in {method}: {words}",
        subject=f"{package.name} {package.version}",
        action="Report it to its maker, or uninstall it; a file of --log-file has where it failed",
    )


@lru_cache
def _foreign(path: tuple[str, ...]) -> Mapping[str, Distribution]:
    """The packages of others that announce plug-ins, by the first name of the modules that these are in."""
    points = [point for group in Group for point in _announced(group, path)]
    found = {point.module.partition(".")[0]: point.dist for point in points}
    return {root: dist for root, dist in found.items() if dist is not None and dist.name != OWN}


@lru_cache
def _announced(group: Group, path: tuple[str, ...]) -> EntryPoints:  # noqa: ARG001 - where packages are found
    """What all packages announce, read once: it takes milliseconds, and a cell names many plug-ins."""
    return entry_points(group=group.entry_points)


def _only(group: Group, name: str) -> EntryPoint:
    points = _announced(group, tuple(sys.path)).select(name=name)
    if not (by_target := {point.value: point for point in points}):
        known = names(group)
        action = did_you_mean(name, known) or f"Known are: {', '.join(known) or 'none'}"
        raise UsageError(f"there is no {group.noun} '{name}'", action=action)
    found = list(by_target.values())
    if len(found) > 1:
        problem = f"{group.noun} '{name}' is defined more than once, by {_packages(found)}"
        raise UsageError(problem, action="Uninstall all but one")
    return found[0]


def broken(group: Group, name: str, reason: str) -> PluginFailed:
    """The error for a plug-in that is not what it must be, with its package and version."""
    point = _only(group, name)
    return PluginFailed(
        f"{group.noun} '{name}' cannot be loaded from {point.value}: {reason}",
        subject=f"{point.dist.name} {point.dist.version}" if point.dist else None,
        action=f"Repair or uninstall {_packages([point])}",
    )


def _packages(points: Sequence[EntryPoint]) -> str:
    return " and ".join(sorted(point.dist.name if point.dist else "an unknown package" for point in points))
