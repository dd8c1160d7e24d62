"""Libraries that only some devices need: imported when a cell has one of these, and named when missing."""

import functools
import inspect
from collections.abc import Awaitable, Callable
from importlib import import_module
from typing import Any, TypeVar, cast

from hexacell.errors import DeviceError, HexacellError, UsageError

PROJECT = "hexacell"


def optional(module: str, extra: str, subject: str) -> Any:  # noqa: ANN401 - a module, of whatever type
    """The module of an optional library.

    Raises:
        UsageError: it is not installed; the message has the command.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise UsageError(
            f"needs {module.partition('.')[0]}, which is not installed ({error})",
            subject=subject,
            action=f"Type: pip install '{PROJECT}[{extra}]'",
        ) from error


LIBRARIES = frozenset({"serial", "can", "canopen", "termios", "pyvisa", "pymodbus", "cantools"})
"""Modules whose exceptions are about a device."""

Device = TypeVar("Device")


def translated(device: Device, subject: str) -> Device:
    """The device, whose coroutines raise a ``DeviceError`` where a library or the system failed.

    An error of any other kind is a fault of the driver, and stays what it is.
    """
    return cast("Device", _Translated(device, subject))


class _Translated:
    def __init__(self, device: object, subject: str) -> None:
        self._device, self._subject = device, subject

    def __getattribute__(self, name: str) -> Any:  # noqa: ANN401
        """Its class is the device's own: whoever asks what it is learns that."""
        if name == "__class__":
            return type(object.__getattribute__(self, "_device"))
        return object.__getattribute__(self, name)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the device has
        found = getattr(self._device, name)
        return self._wrapped(found) if inspect.iscoroutinefunction(found) else found

    def _wrapped(self, call: Callable[..., Awaitable[Any]]) -> Callable[..., Awaitable[Any]]:
        @functools.wraps(call)
        async def wrapped(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401
            try:
                return await call(*arguments, **named)
            except HexacellError:
                raise
            except Exception as error:
                library = type(error).__module__.partition(".")[0]
                if not isinstance(error, OSError | EOFError) and library not in LIBRARIES:
                    raise
                raise DeviceError(
                    f"its driver failed: {type(error).__name__}: {error}",
                    subject=self._subject,
                    action="Check the device and its cable; if they are sound, inform the driver's maker",
                ) from error

        return wrapped
