"""The device interfaces that procedures use. Drivers and simulations implement them.

Every device has the same life cycle: ``open`` connects and identifies it, then it is read or operated,
``close`` releases it; it can be opened again. Every call is a coroutine, so a slow device never blocks
the others or a stop. Every failure is a :class:`hexacell.errors.DeviceError` that names the device;
those that a run reacts to in a way of their own are in :mod:`drivers.errors`.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol, TypeVar, runtime_checkable

from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.pose import Pose

Identity_co = TypeVar("Identity_co", covariant=True)


@dataclass(frozen=True, slots=True)
class DeviceIdentity:
    """The identity of a device: recorded with every run, compared after every reconnection.

    Attributes:
        name: unique in the cell, as messages name it.
        settings: what is set in the device that changes the meaning of its readings, in words.
        port: the place or the adapter that it is connected to, where the operating system knows it.
        remark: what a person should know of it now; not compared.
    """

    name: str
    protocol: str
    description: str
    serial_number: str = ""
    settings: str = ""
    port: str = ""
    remark: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class GaugeReading:
    """One reading of a dial indicator: its value, mm, and the raw answer."""

    value_mm: float
    raw: str


@dataclass(frozen=True, slots=True)
class EncoderSample:
    """Joint variables ``positions`` (J,) sampled at one instant, in ``unit``, mm or deg.

    ``counts`` (J,) are the raw ones, as the encoders send them.
    """

    counts: tuple[int, ...]
    positions: tuple[float, ...]
    unit: JointUnit = JointUnit.MM


class StartupAction(StrEnum):
    """What makes a controller ready to move; done only where it is permitted.

    The emergency stop that a controller starts in is another one than one that came later.
    """

    RESET_INITIAL_ESTOP = "reset-estop"
    RESET_ESTOP = "reset-later-estop"
    SWITCH_ON = "switch-on"
    HOME = "home"


StartupActions = frozenset[StartupAction]


@dataclass(frozen=True, slots=True)
class ControllerStatus:
    """A controller's status: emergency stop, enabled, and its error messages.

    ``heartbeat`` changes whenever the joints move, or more often, as long as the controller works;
    empty where there is none. One that is frozen may still answer, but with the same.
    """

    estop: bool
    enabled: bool
    error_messages: tuple[str, ...] = ()
    heartbeat: str = ""

    @property
    def may_move(self) -> bool:
        """Whether it can move."""
        return self.enabled and not self.estop


@dataclass(frozen=True, slots=True)
class ReportedPosition:
    """Where a controller has the robot: its pose by its own forward kinematics, mm and deg.

    ``joints`` are its joint variables (J,), mm or deg; None where its protocol does not report them.
    """

    pose: Pose
    joints: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class TemperatureReading:
    """A temperature, deg C, and the raw answer."""

    celsius: float
    raw: str


class Device(Protocol[Identity_co]):
    """The life cycle of every device."""

    async def open(self) -> Identity_co:
        """Connect, and check that it is the expected device in usable settings; nothing moves.

        It gives its identity, or those of all its parts.
        """

    async def close(self) -> None:
        """Release the connection; closing twice is harmless."""


class Gauge(Device[DeviceIdentity], Protocol):
    """A dial indicator. Its zero is kept in software; the instrument's own zero is not changed."""

    @property
    def name(self) -> str:
        """Its name in the cell file."""

    async def read(self) -> GaugeReading:
        """The plunger's position now, mm, in its own zero and direction, once readings agree."""

    async def read_once(self) -> GaugeReading:
        """The value of a single query, mm, also during motion: for supervision, never for a record.

        Raises:
            drivers.errors.WrongAnswer: the answer is garbled.
        """

    async def check(self) -> None:
        """Raise if unit, preset, direction or hold changed since ``open``: the zero is then void."""


class EncoderBank(Device[tuple[DeviceIdentity, ...]], Protocol):
    """Encoders of the joints that are sampled simultaneously."""

    async def read(self) -> EncoderSample:
        """One complete sample of all encoders, all of the same instant."""


class Controller(Device[DeviceIdentity], Protocol):
    """The robot's own controller."""

    async def prepare(self, permitted: StartupActions) -> None:
        """Make it ready to move by permitted actions: out of emergency stop, enabled, homed. It may move.

        Raises:
            drivers.errors.StartupNotPermitted: it needs an action that is not permitted.
        """

    async def move(self, pose: Pose, duration_s: float) -> None:
        """Move straight to a pose in its own frames, in no less than ``duration_s``; returns on arrival."""

    async def position(self) -> ReportedPosition | None:
        """Where it has the robot now, pose and joints; None before it is homed, when nobody knows."""

    async def status(self) -> ControllerStatus:
        """Its emergency stop, enabled, error messages and heartbeat now, also during ``move``."""

    async def stop(self) -> None:
        """Stop the motion in place, at once, also during ``move``."""

    async def reload(self, permitted: StartupActions) -> None:
        """Make it reload its config; joints must not move. Afterwards it is as ``prepare`` leaves it.

        It is switched off and on for that, without permission where it was on before.

        Raises:
            drivers.errors.StartupNotPermitted: it needs another action; ``prepare`` may complete it.
        """


@runtime_checkable
class CheckedController(Protocol):
    """A controller whose settings can be checked before it is made ready to move."""

    async def check(self) -> None:
        """Raise if units, offsets or modes of it lead commands elsewhere; nothing is set, nothing moves."""


class StopInput(Device[DeviceIdentity | None], Protocol):
    """A contact or a file that forbids motion; without hardware it has no identity."""

    async def active_reason(self) -> str | None:
        """Why motion is forbidden now, in words; None if it is allowed. A lost line forbids it."""


class Thermometer(Device[DeviceIdentity], Protocol):
    """A temperature sensor. A run continues without it."""

    @property
    def name(self) -> str:
        """Its name in the cell file."""

    async def read(self) -> TemperatureReading:
        """The temperature now, deg C, within the time-out of the cell file."""
