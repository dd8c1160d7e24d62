"""What every rule of a guard works with: the limits of an action, and how a trip is put together."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.mechanism import MechanismWords
from hexacell.kinematics.rotations import Array
from hexacell.limits.gauge_travel import GaugeRoom
from procedures.guards.polling import DevicePoller, PolledDevices
from procedures.run.trips import Guard, Trip

MAX_GARBLED = 3
"""So many garbled answers in a row are a device fault; fewer are noise on the line."""


@dataclass(frozen=True, slots=True)
class GuardLimits:
    """The limits of one action.

    Attributes:
        stale_s: longest silence of a device, s of real time.
        plate: how far the ball may go from the set's reference.
        words: the mechanism's, for a joint and its unit.
        rest: largest displacement of a joint at standstill, in its unit; None while the robot moves.
    """

    stale_s: float
    plate: GaugeRoom
    words: MechanismWords
    rest: float | None = None


Rule = Callable[[PolledDevices, GuardLimits], Trip | None]
"""A function of the latest answers that gives a trip, or None."""


def fault_trip(guard: Guard, report: DevicePoller[object]) -> Trip:
    """The trip of a device that reports an error."""
    assert report.error is not None  # noqa: S101 - callers have checked it
    error = report.error
    action = error.action or "Check it, then resume"
    return Trip(guard, error.subject or report.device, error.problem, action, (error,))


def joint_trip(joint: str, difference: Array, limit: float, words: str) -> Trip | None:
    """The trip of the joint with the largest difference, if that is beyond its limit."""
    leg = int(np.argmax(np.abs(difference)))
    if abs(difference[leg]) <= limit:
        return None
    return Trip(
        Guard.FOLLOWING,
        f"{joint} {leg + 1}",
        words.format(difference[leg]),
        "Look for what holds or moves that leg, and whether encoders and controller count alike",
    )
