"""A guard that tripped: which, why, and the next action."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum

from hexacell.errors import DeviceError, ExitCode, HexacellError, LimitError, flatten_errors


class Guard(StrEnum):
    """What is watched; the values are journalled."""

    STOP_LINE = "stop line"
    CONTROLLER = "controller"
    FOLLOWING = "following"
    GAUGE_END = "gauge at its end"
    PLATE = "ball off the plate"
    DEVICE = "device"
    STALE = "stale device"
    ENCODERS = "encoders"
    DRIFT = "drift"
    POSITION = "position"
    DISK = "disk"


@dataclass(frozen=True, slots=True)
class Trip:
    """One guard, the device it tripped on, the fact as a sentence part, and the next action.

    ``causes`` are what devices said of themselves, where that is what it tripped on.
    """

    guard: Guard
    device: str
    problem: str
    action: str
    causes: tuple[HexacellError, ...] = field(default=(), compare=False)

    @property
    def is_about_the_ball(self) -> bool:
        """Whether all devices work and only the pose was outside the gauges' range."""
        return self.guard in {Guard.GAUGE_END, Guard.PLATE}

    def as_error(self) -> GuardTripped:
        """The error to raise for it."""
        return (DriftTripped if self.guard is Guard.DRIFT else GuardTripped)(self)

    def unstopped(self, reason: str) -> Trip:
        """The same where the robot could not be stopped: then that comes first."""
        return replace(
            self,
            problem=f"{self.problem}, and the robot could not be stopped: {reason}",
            action="Press the emergency stop",
        )


class GuardTripped(DeviceError):
    """A guard stopped the robot, or kept it from moving; latched until it is cleared."""

    exit_code = ExitCode.HARDWARE

    def __init__(self, trip: Trip) -> None:
        self.trip = trip
        super().__init__(trip.problem, subject=trip.device, action=trip.action)


class DriftTripped(GuardTripped, LimitError):
    """The gauges show another value at a set's reference than before: the set does not count."""

    exit_code = ExitCode.OUT_OF_LIMITS


def causes_of(error: HexacellError) -> list[HexacellError]:
    """What one report is made of: the errors that came at once, and those that a guard tripped on."""
    found: list[HexacellError] = []
    for one in flatten_errors(error):
        found += one.trip.causes if isinstance(one, GuardTripped) and one.trip.causes else (one,)
    return found
