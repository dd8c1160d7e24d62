"""Failures of devices: one class for each reaction of a run.

A failure without a reaction of its own is a plain :class:`hexacell.errors.DeviceError`.
"""

from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError


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
    """A configured encoder no longer responds to SYNC or SDO requests, or its heartbeat is missing."""


class RestartedNodeError(DeviceError):
    """An encoder restarted and lost its configuration during a run: the set is void."""


class InvalidSampleError(DeviceError):
    """An encoder reports an error that makes its position invalid, until it reports that it is gone."""


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
