"""Failures of devices: one class for each reaction of a run; and of libraries that only some devices need.

A failure without a reaction of its own is a plain :class:`hexacell.errors.DeviceError`.
"""

import functools
import inspect
from importlib import import_module
from typing import Any, TypeVar, cast

from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError, HexacellError, UsageError
from hexacell.plugins import plugin_failure


class PortLost(DeviceError):
    """A serial port is not available, or was lost."""


class GaugeSilent(DeviceError):
    """No answer."""


class EmptyChannel(GaugeSilent):
    """A multiplexer answers that no instrument does."""


class WrongAnswer(DeviceError):
    """An answer that does not conform to the protocol."""


class WrongSetting(DeviceError):
    """Inches, hold, a peak mode, scaling or a low battery: readings are invalid, or soon will be."""


class GaugeAtEnd(DeviceError):
    """The plunger is at an end of its travel: this record is invalid, the zero remains valid."""


class GaugeUnsteady(DeviceError):
    """Consecutive readings do not agree: the plunger moves, or the line is noisy."""


class ZeroVoid(DeviceError):
    """The instrument's zero may have changed: every reading since the last reference is void."""


class BusError(DeviceError):
    """The encoders' bus cannot be opened, has failed, lacks a node, or is used by another master."""


class SilentNodeError(DeviceError):
    """Encoders, of ``legs`` where known, no longer respond to SYNC or requests, or lack a heartbeat."""

    legs: frozenset[int] = frozenset()


class RestartedNodeError(DeviceError):
    """An encoder restarted and lost its configuration during a run: the set is void."""


class InvalidSampleError(DeviceError):
    """An encoder reports an error that makes its position invalid, until it reports that it is gone."""


def invalid_sample(what: str, subject: str, action: str) -> InvalidSampleError:
    """The error for positions that the device itself reports as invalid, or that cannot be."""
    return InvalidSampleError(f"{what}; its position cannot be trusted", subject=subject, action=action)


def silent_encoder(what: str, subject: str, remedy: str) -> SilentNodeError:
    """The error for an encoder that does not answer; ``remedy`` is what to do before it is opened again."""
    action = f"{remedy}, then try again; the set that was being measured is void"
    return SilentNodeError(what, subject=subject, action=action)


TIMES_ASKED, PAUSE_S = 4, 0.1
"""How often a device is asked that refuses for a reason that may pass, and the pause between."""


class NotHomedError(DeviceError):
    """Encoders that the controller reads have no position yet: its joints are not homed."""


class ConnectionLost(DeviceError):
    """There is no connection to the controller, or it broke."""


class ResponseTimeout(ConnectionLost):
    """The connection is open, but there is no response in time: the controller is frozen."""


class ControllerFrozen(ResponseTimeout):
    """It answers, but always the same, although the joints move: the part that controls them stands."""


class StartupNotPermitted(DeviceError):
    """The controller is not ready, and what it needs is not permitted; nothing was done."""

    def __init__(self, action: StartupAction, subject: str) -> None:
        self.needed = action
        super().__init__(_UNREADY[action], subject=subject)


_UNREADY = {
    StartupAction.RESET_INITIAL_ESTOP: "is in emergency stop since it was started",
    StartupAction.RESET_ESTOP: "is in emergency stop",
    StartupAction.SWITCH_ON: "is switched off",
    StartupAction.HOME: "is not homed",
}


class CommandRefused(DeviceError):
    """The controller refused a command, for ``reason``."""

    def __init__(self, command: str, reason: str, *, subject: str, action: str | None = None) -> None:
        self.reason = reason
        super().__init__(f"refuses {command}: {reason}", subject=subject, action=action)


class MoveRefused(CommandRefused):
    """The controller refused a target; nothing moved."""


class PoseRefused(MoveRefused):
    """The pose itself is refused: beyond a limit, or out of reach. The controller takes others.

    Attributes:
        axis: beyond whose limit it is, one of ``xyzabc``; None if the controller gave another reason.
        is_highest: whether that is the axis' highest value, not its lowest.
    """

    def __init__(
        self, command: str, reason: str, *, subject: str, axis: str | None = None, is_highest: bool = True
    ) -> None:
        self.axis = axis
        self.is_highest = is_highest
        super().__init__(command, reason, subject=subject)


class MotionInterrupted(DeviceError):
    """A motion ended, or was stopped, before its target."""


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
            action=f"Type: pip install 'hexacell[{extra}]'",
        ) from error


LIBRARIES = frozenset({"serial", "can", "canopen", "termios", "pyvisa", "pymodbus", "cantools"})
"""Modules whose exceptions are about a device."""

Device = TypeVar("Device")


def translated(device: Device, subject: str) -> Device:
    """The device, whose coroutines raise a ``DeviceError`` where a library or the system failed.

    An error of any other kind is a fault of the driver; one of a plug-in names its package.
    """
    return cast("Device", _Translated(device, subject))


class _Translated:
    def __init__(self, device: object, subject: str) -> None:
        self._device, self._subject = device, subject

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        """The device's own: whoever asks what it is learns that."""
        return type(self._device)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the device has
        found = getattr(self._device, name)
        if not inspect.iscoroutinefunction(found):
            return found

        @functools.wraps(found)
        async def wrapped(*arguments: Any, **named: Any) -> Any:  # noqa: ANN401
            try:
                return await found(*arguments, **named)
            except HexacellError:
                raise
            except Exception as error:
                library = type(error).__module__.partition(".")[0]
                if not isinstance(error, OSError | EOFError) and library not in LIBRARIES:
                    if (failed := plugin_failure(error)) is not None:
                        raise failed from error
                    raise
                raise DeviceError(
                    f"its driver failed: {type(error).__name__}: {error}",
                    subject=self._subject,
                    action="Check the device and its cable; if they are sound, inform the driver's maker",
                ) from error

        return wrapped
