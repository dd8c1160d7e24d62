"""Errors of the encoders, each with a next action, and the legs that they name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hexacell.errors import DeviceError


class BusError(DeviceError):
    """The CAN bus cannot be opened, has failed, or is used by another master."""


class NodeError(DeviceError):
    """A problem of one or more encoders, those of ``legs``."""

    def __init__(self, problem: str, *legs: Leg, action: str) -> None:
        self.legs = legs
        super().__init__(problem, subject=subject_of(legs), action=action)


class MissingNodeError(NodeError):
    """No device responds under a node id of the cell file."""


class DuplicatedNodeError(NodeError):
    """Two devices respond under one node id."""


class WrongDeviceError(NodeError):
    """The device that responds is not the one described in the cell file."""


class ConfigurationError(NodeError):
    """The device refuses a setting that is needed for one sample per SYNC."""


class SilentNodeError(NodeError):
    """A configured node no longer responds to SYNC or SDO requests, or its heartbeat is missing."""


class RestartedNodeError(NodeError):
    """A node restarted and lost its configuration during a run: the set is void."""


class InvalidSampleError(NodeError):
    """A node reports an error that makes its position invalid, until it reports that it is gone."""


@dataclass(frozen=True, slots=True)
class Leg:
    """One leg's encoder; ``number`` counts from 1, ``node`` is the CANopen node id (1 to 127)."""

    number: int
    node: int

    def __str__(self) -> str:
        return f"leg {self.number} (node {self.node})"


def subject_of(legs: Sequence[Leg]) -> str:
    """The subject of an error message about one or more legs."""
    noun = "encoder of" if len(legs) == 1 else "encoders of"
    return f"{noun} {', '.join(str(leg) for leg in legs)}"
