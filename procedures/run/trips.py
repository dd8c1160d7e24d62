"""A guard that tripped: which, why, and the next action."""

from dataclasses import dataclass, field
from enum import StrEnum

from hexacell.errors import DeviceError, ExitCode, HexacellError, LimitError, SeveralErrors, flatten_errors


class Guard(StrEnum):
    """What is watched; the values are journalled."""

    STOP_LINE = "stop line"
    EMERGENCY_STOP = "emergency stop"
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

    ``causes`` are what devices said of themselves, where that is what it tripped on. ``stop_failure`` is
    why the robot could not be stopped; empty where it was.
    """

    guard: Guard
    device: str
    problem: str
    action: str
    causes: tuple[HexacellError, ...] = field(default=(), compare=False)
    stop_failure: str = ""

    def as_error(self) -> "GuardTripped":
        """The error to raise for it."""
        return (DriftTripped if self.guard is Guard.DRIFT else GuardTripped)(self)


class GuardTripped(DeviceError):
    """A guard stopped the robot, or kept it from moving; latched until it is cleared."""

    def __init__(self, trip: Trip) -> None:
        self.trip = trip
        super().__init__(trip.problem, subject=trip.device, action=trip.action)

    def __str__(self) -> str:
        text, failure = super().__str__(), self.trip.stop_failure
        return _MAY_STILL_MOVE.format(f"{failure}\n{text}") if failure else text


class RobotNotStopped(SeveralErrors, DeviceError):
    """The robot may still move: it could not be stopped after an error, which comes second."""

    def __init__(self, stop_failure: HexacellError, error: HexacellError) -> None:
        super().__init__("the robot may still move", [stop_failure, *flatten_errors(error)])
        self.exit_code = ExitCode.HARDWARE

    def __str__(self) -> str:
        stop_failure, *others = self.errors
        return _MAY_STILL_MOVE.format("\n".join(map(str, (stop_failure, *others))))


def may_still_move(error: BaseException) -> bool:
    """Whether an error says that the robot could not be stopped."""
    if isinstance(error, GuardTripped):
        return bool(error.trip.stop_failure)
    return isinstance(error, RobotNotStopped)


_MAY_STILL_MOVE = "PRESS THE EMERGENCY STOP. The robot could not be stopped and may still move: {}"


class DriftTripped(GuardTripped, LimitError):
    """The gauges show another value at a set's reference than before: the set does not count."""

    exit_code = ExitCode.OUT_OF_LIMITS


def causes_of(error: HexacellError) -> list[HexacellError]:
    """What one report is made of: the errors that came at once, and those that a guard tripped on."""
    found: list[HexacellError] = []
    for one in flatten_errors(error):
        found += one.trip.causes if isinstance(one, GuardTripped) and one.trip.causes else (one,)
    return found


@dataclass(frozen=True, slots=True)
class WatchedSet:
    """What the gauges of a set must show during a move within it.

    Attributes:
        zero_mm: what they showed along base x, y, z when they were zeroed; None before that, and where they
            do not stay around the ball: their readings are not used then.
        moved_mm: by how much the ball surely moves along x, y, z; None where nothing is expected.
    """

    zero_mm: tuple[float, float, float] | None
    moved_mm: tuple[float, ...] | None = None
