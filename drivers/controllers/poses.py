"""Whether a controller is where it should be, by what it reports."""

import math
from collections.abc import Sequence

from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import AXES, Pose

_ASIDE_MM, _ASIDE_SHARE = 5.0, 0.05
"""How much longer than a straight move the way over a pose on it may be, also as a share of it."""


def on_wire(pose: Pose, coordinates: str) -> list[float]:
    """Those coordinates of a pose that a robot has, mm and deg."""
    return [value for axis, value in zip(AXES, pose.as_tuple(), strict=True) if axis in coordinates]


def from_wire(numbers: Sequence[float], coordinates: str) -> Pose:
    """The pose of as many numbers as the robot has coordinates; the others are 0, and mean nothing.

    Raises:
        ValueError: there are more or fewer.
    """
    return Pose(**{**dict.fromkeys(AXES, 0.0), **dict(zip(coordinates, numbers, strict=True))})


def pose_difference(one: Pose, other: Pose) -> tuple[float, float]:
    """The largest difference of a position, mm, and of an angle, deg, less full turns."""
    differences = [a - b for a, b in zip(one.as_tuple(), other.as_tuple(), strict=True)]
    angles = [math.remainder(difference, 360.0) for difference in differences[3:]]
    return max(map(abs, differences[:3])), max(map(abs, angles))


def agree(one: Pose, other: Pose, settings: ControllerSettings, tolerances: float = 1.0) -> bool:
    """Whether two poses are the same within so many tolerances, in the coordinates that the robot has."""
    own = settings.coordinates
    position, angle = pose_difference(*(from_wire(on_wire(pose, own), own) for pose in (one, other)))
    return (
        position <= tolerances * settings.position_tolerance_mm
        and angle <= tolerances * settings.angle_tolerance_deg
    )


def aside(start: Pose, at: Pose, target: Pose) -> str | None:
    """What is wrong with a pose on the way of a straight move, if anything is."""
    begin, here, end = (one.as_tuple()[:3] for one in (start, at, target))
    length = math.dist(begin, end)
    over = math.dist(begin, here) + math.dist(here, end)
    if over - length <= _ASIDE_MM + _ASIDE_SHARE * length:
        return None
    return f"says that it is at {at}, which is not on the way from {start} to {target}"


def require_unmoved(
    before: tuple[float, ...], after: tuple[float, ...], tolerance_mm: float, subject: str
) -> None:
    """Raise ``DeviceError`` if a joint moved while a controller read its config again."""
    moved = [abs(new - old) for new, old in zip(after, before, strict=True)]
    if max(moved) > tolerance_mm:
        joint, by_mm = moved.index(max(moved)) + 1, max(moved)
        raise DeviceError(
            f"moved joint {joint} by {by_mm:.3f} mm while it read its config again",
            subject=subject,
            action="Check the machine and its config before it moves again",
        )
