"""Errors of robot controllers, whatever their protocol."""

from __future__ import annotations

from hexacell.errors import DeviceError


class ConnectionLost(DeviceError):
    """There is no connection to the controller, or it broke."""


class ResponseTimeout(ConnectionLost):
    """No response in time; it may still come."""


class CommandRefused(DeviceError):
    """The controller refused a command, for ``reason``."""

    def __init__(self, command: str, reason: str, *, subject: str, action: str | None = None) -> None:
        self.reason = reason
        super().__init__(f"refuses {command}: {reason}", subject=subject, action=action)


class MoveRefused(CommandRefused):
    """The controller refused a target; nothing moved."""


class MotionInterrupted(DeviceError):
    """A motion ended, or was stopped, before its target."""
