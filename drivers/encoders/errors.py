"""What can go wrong between the encoders and us; every one a ``DeviceError`` with a next action."""

from __future__ import annotations

from drivers.encoders.legs import Leg, subject_of
from hexacell.errors import DeviceError


class BusError(DeviceError):
    """The CAN bus cannot be opened, has died, or is not ours alone."""


class NodeError(DeviceError):
    """A problem of one encoder or several; ``legs`` are those concerned."""

    def __init__(self, problem: str, *legs: Leg, action: str) -> None:
        self.legs = legs
        super().__init__(problem, subject=subject_of(legs), action=action)


class MissingNodeError(NodeError):
    """Nobody answers under a node id that the cell file names."""


class DuplicatedNodeError(NodeError):
    """Two devices answer under one node id."""


class WrongDeviceError(NodeError):
    """Somebody answers, but not the device that the cell file describes."""


class ConfigurationError(NodeError):
    """The device does not take the settings that one sample per SYNC needs."""


class SilentNodeError(NodeError):
    """A configured node no longer answers SYNC, SDO requests, or sends no heartbeat."""


class RestartedNodeError(NodeError):
    """A node lost its configuration in the middle of a run: the set is void."""


class InvalidSampleError(NodeError):
    """A node reports an error that falsifies its position, until it says that it is gone."""
