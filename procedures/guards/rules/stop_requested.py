"""A stop input forbids motion."""

from drivers.stop_input import SUBJECT as STOP_LINE
from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits
from procedures.run.trips import Guard, Trip


def stop_requested(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    line = devices.stop_input
    return None if line is None or not line.value else motion_forbidden(line.value)


def motion_forbidden(reason: str) -> Trip:
    """The trip for an active stop input."""
    return Trip(
        Guard.STOP_LINE,
        STOP_LINE,
        f"motion is forbidden: {reason}",
        "Release it when the robot may move, then resume",
    )
