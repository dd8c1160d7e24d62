"""What guards judge: how long ago each device was heard, and what it said."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.errors import HexacellError

T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True, slots=True)
class DeviceReport(Generic[T_co]):
    """The latest of one device.

    Attributes:
        device: its name, as errors have it.
        silent_s: how long ago it last answered anything, s on the wall.
        value: what it said last; nothing if it has not yet.
        first: what it said first.
        error: why the latest question had no value for an answer.
        garbled: how many answers in a row made no sense.
    """

    device: str
    silent_s: float = 0.0
    value: T_co | None = None
    first: T_co | None = None
    error: HexacellError | None = None
    garbled_count: int = 0


@dataclass(frozen=True, slots=True)
class GaugeDeviation:
    """A gauge in the middle of a set: how far its plunger is from the set's reference, mm."""

    axis: int
    deviation_mm: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All that is watched, in one moment; what is not watched is empty."""

    gauges: tuple[DeviceReport[GaugeDeviation], ...] = ()
    encoders: DeviceReport[EncoderSample] | None = None
    controller: DeviceReport[ControllerStatus] | None = None
    stop_input: DeviceReport[str] | None = None
    """Its value is why motion is forbidden; empty while it is not."""


@dataclass(frozen=True, slots=True)
class GuardLimits:
    """What a snapshot is held against during one action.

    Attributes:
        stale_s: longest silence, s on the wall.
        plate_mm: largest deviation from the set's reference along any axis.
        rest_mm: largest way of a slider where the robot must stand still; none where it moves.
    """

    stale_s: float
    plate_mm: float
    rest_mm: float | None = None
