"""Errors of robot controllers, whatever their protocol."""

from __future__ import annotations

from drivers.interfaces import StartupAction
from hexacell.errors import DeviceError


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
        axis: beyond whose limit it is, one of ``xyzabc``; none if the controller gave another reason.
        is_highest: whether that is the axis' highest value, not its lowest.
    """

    def __init__(
        self,
        command: str,
        reason: str,
        *,
        subject: str,
        axis: str | None = None,
        is_highest: bool = True,
    ) -> None:
        self.axis = axis
        self.is_highest = is_highest
        super().__init__(command, reason, subject=subject)


class MotionInterrupted(DeviceError):
    """A motion ended, or was stopped, before its target."""
