"""What the procedures may ask of hardware: small protocols, no word on how it is done.

Every call is a coroutine, so that a slow device never holds up the others or an abort. Every
failure is a :class:`hexacell.errors.DeviceError` whose subject is the device's name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from hexacell.kinematics.pose import Pose


@dataclass(frozen=True, slots=True)
class DeviceIdentity:
    """Who answered: kept with every run, compared whenever a device comes back."""

    name: str
    protocol: str
    description: str
    serial_number: str = ""


@dataclass(frozen=True, slots=True)
class GaugeReading:
    """One agreed reading of a dial indicator: its value, mm, and the answer it came in."""

    value_mm: float
    raw: str


@dataclass(frozen=True, slots=True)
class EncoderSample:
    """Six slider positions taken at one SYNC: raw counts, and mm along the rails."""

    counts: tuple[int, ...]
    positions_mm: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ControllerStatus:
    """What a controller says of itself: whether it may move, and what it complains about."""

    estop: bool
    enabled: bool
    error_messages: tuple[str, ...] = ()

    @property
    def may_move(self) -> bool:
        """Whether nothing keeps it from moving."""
        return self.enabled and not self.estop


@dataclass(frozen=True, slots=True)
class TemperatureReading:
    """A temperature, deg C, and the answer it came in."""

    celsius: float
    raw: str


class Gauge(Protocol):
    """A dial indicator. Its zero is kept in software; the instrument's own zero is not touched."""

    @property
    def name(self) -> str:
        """The name the cell file gives it."""
        ...

    async def open(self) -> DeviceIdentity:
        """Connect and refuse a device in a unit or mode that would falsify readings."""
        ...

    async def read(self) -> GaugeReading:
        """The plunger's position now, mm, in the instrument's own zero and direction."""
        ...

    async def read_once(self) -> GaugeReading:
        """What it shows in this moment, moving or not: asked once, agreed with nothing.

        For watching a motion, never for a record. An answer that is garbled raises
        :class:`drivers.gauges.errors.WrongAnswer`; the next one may be whole.
        """
        ...

    async def check(self) -> None:
        """Raise if unit, preset, direction or hold changed since ``open``: the zero is void."""
        ...

    async def close(self) -> None:
        """Let the line go; closing twice is harmless."""
        ...


class EncoderBank(Protocol):
    """Six slider encoders sampled together."""

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """Connect, compare identities and measuring steps, configure and start the nodes."""
        ...

    async def read(self) -> EncoderSample:
        """One complete round: all six at the same instant, or an error."""
        ...

    async def close(self) -> None:
        """Let the bus go; closing twice is harmless."""
        ...


class Controller(Protocol):
    """The robot's own controller, driven as its owner configured it."""

    async def open(self) -> DeviceIdentity:
        """Connect; nothing moves."""
        ...

    async def prepare(self) -> None:
        """Make it ready to move: out of estop, on, homed. May move the machine."""
        ...

    async def move(self, pose: Pose) -> None:
        """Go to ``pose`` and return once there; an acknowledgement alone is not arrival."""
        ...

    async def pose(self) -> Pose:
        """The pose the controller believes the platform to have."""
        ...

    async def status(self) -> ControllerStatus:
        """Whether it is in emergency stop, whether it is on; also while ``move`` waits."""
        ...

    async def stop(self) -> None:
        """Stop motion in place, at once, also while ``move`` waits."""
        ...

    async def reload(self) -> None:
        """Make it read its config again; sliders must not move."""
        ...

    async def close(self) -> None:
        """Let the connection go; closing twice is harmless."""
        ...


class StopInput(Protocol):
    """A contact or a file by which anybody may forbid motion."""

    async def open(self) -> DeviceIdentity | None:
        """Get ready to look at it; gives the device that it is, if it is one."""
        ...

    async def active_reason(self) -> str | None:
        """Why nothing may move now, in words, or nothing. Fails safe: a lost line forbids."""
        ...

    async def close(self) -> None:
        """Let it go; closing twice is harmless."""
        ...


class Thermometer(Protocol):
    """Something that knows how warm it is. A run goes on without it."""

    @property
    def name(self) -> str:
        """The name the cell file gives it."""
        ...

    async def open(self) -> DeviceIdentity:
        """Connect."""
        ...

    async def read(self) -> TemperatureReading:
        """The temperature now, or a ``DeviceError`` within the time that the cell file allows."""
        ...

    async def close(self) -> None:
        """Let it go; closing twice is harmless."""
        ...
