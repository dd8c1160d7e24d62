"""The input of the guard rules: the latest report of each device, and the limits in force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from drivers.interfaces import ControllerStatus, EncoderSample
from hexacell.errors import HexacellError

T_co = TypeVar("T_co", covariant=True)


@dataclass(frozen=True, slots=True)
class DeviceReport(Generic[T_co]):
    """The latest state of one device.

    Attributes:
        device: its name, as in error messages.
        silent_s: time since the last answer on its line, s of real time.
        value: the latest value; none before the first answer.
        first: the first value.
        error: the error of the latest poll, if it gave no value.
        garbled_count: how many answers in a row were garbled.
    """

    device: str
    silent_s: float = 0.0
    value: T_co | None = None
    first: T_co | None = None
    error: HexacellError | None = None
    garbled_count: int = 0


@dataclass(frozen=True, slots=True)
class GaugeDeviation:
    """The deviation of a gauge from the reference of its set, mm along base axis ``axis`` (0 to 2)."""

    axis: int
    deviation_mm: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The reports of all supervised devices at one moment; a device that is not supervised has none."""

    gauges: tuple[DeviceReport[GaugeDeviation], ...] = ()
    encoders: DeviceReport[EncoderSample] | None = None
    controller: DeviceReport[ControllerStatus] | None = None
    stop_input: DeviceReport[str] | None = None
    """Its value is the reason why motion is forbidden; empty while motion is allowed."""


@dataclass(frozen=True, slots=True)
class GuardLimits:
    """The limits of one action.

    Attributes:
        stale_s: longest silence of a device, s of real time.
        plate_mm: largest deviation from the set's reference along any axis.
        rest_mm: largest slider displacement at standstill; none while the robot moves.
    """

    stale_s: float
    plate_mm: float
    rest_mm: float | None = None
