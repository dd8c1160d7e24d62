"""What can go wrong with a robot controller, whichever protocol it speaks."""

from __future__ import annotations

from hexacell.errors import DeviceError


class ConnectionLost(DeviceError):
    """There is no line to the controller, or it broke."""


class ResponseTimeout(ConnectionLost):
    """Nothing came over the line in time; it may still come."""


class CommandRefused(DeviceError):
    """The controller understood a command and did not do it, for ``reason``."""

    def __init__(self, command: str, reason: str, *, subject: str, action: str | None = None) -> None:
        self.reason = reason
        super().__init__(f"refuses {command}: {reason}", subject=subject, action=action)


class MoveRefused(CommandRefused):
    """The controller did not accept a target; nothing moved."""


class MotionInterrupted(DeviceError):
    """A motion ended, or was stopped, somewhere other than at its target."""
