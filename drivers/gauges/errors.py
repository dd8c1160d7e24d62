"""What a dial indicator can do wrong, as kinds that procedures can tell apart."""

from __future__ import annotations

from hexacell.errors import DeviceError


class GaugeSilent(DeviceError):
    """Nothing came back at all."""


class WrongAnswer(DeviceError):
    """Something came back, and it is not what the protocol says."""


class WrongUnit(DeviceError):
    """The instrument shows inches; its readings are never converted."""


class WrongMode(DeviceError):
    """Hold, a peak mode, scaling or a low battery: readings mean nothing, or soon will not."""


class GaugeAtEnd(DeviceError):
    """The plunger is at an end of its travel: this record is invalid, the zero is not."""


class GaugeUnsteady(DeviceError):
    """Readings in a row do not agree: the plunger moves, or the line is noisy."""


class ZeroVoid(DeviceError):
    """The instrument's zero may have changed: every reading since the last reference is void."""


class FrameRejected(Exception):
    """A frame that does not match its protocol in full; asked again, never shown to a person."""

    def __init__(self, frame: bytes) -> None:
        self.frame = frame
        super().__init__(frame)
