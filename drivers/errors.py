"""Failures of gauges, encoders and serial ports: one class for each reaction of a run.

A failure without a reaction of its own is a plain :class:`hexacell.errors.DeviceError`.
"""

from __future__ import annotations

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
