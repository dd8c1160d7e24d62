"""What can go wrong between the encoders and us; every one a ``DeviceError`` with a next action.

How an encoder is named: the leg it belongs to and the node id it answers under.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class Leg:
    """One leg's encoder; ``number`` counts from 1, ``node`` is the CANopen node id (1 to 127)."""

    number: int
    node: int

    def __str__(self) -> str:
        return f"leg {self.number} (node {self.node})"


def subject_of(legs: Sequence[Leg]) -> str:
    """The words that begin an error message about one leg or several."""
    noun = "encoder of" if len(legs) == 1 else "encoders of"
    return f"{noun} {', '.join(str(leg) for leg in legs)}"
