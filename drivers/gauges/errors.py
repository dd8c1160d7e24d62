"""Errors of dial indicators, one class for each kind of reaction."""

from __future__ import annotations

from hexacell.errors import DeviceError


class GaugeSilent(DeviceError):
    """No answer."""


class WrongAnswer(DeviceError):
    """An answer that does not conform to the protocol."""


class WrongUnit(DeviceError):
    """The instrument displays inches; its readings are never converted."""


class WrongMode(DeviceError):
    """Hold, a peak mode, scaling or a low battery: readings are invalid, or soon will be."""


class GaugeAtEnd(DeviceError):
    """The plunger is at an end of its travel: this record is invalid, the zero remains valid."""


class GaugeUnsteady(DeviceError):
    """Consecutive readings do not agree: the plunger moves, or the line is noisy."""


class ZeroVoid(DeviceError):
    """The instrument's zero may have changed: every reading since the last reference is void."""


class FrameRejected(Exception):
    """A frame that does not fully match the protocol; the request is repeated. Never shown to users."""

    def __init__(self, frame: bytes) -> None:
        self.frame = frame
        super().__init__(frame)
