"""Whether a controller is where it should be, by what it reports."""

import math

from hexacell.cell.robot import ControllerSettings
from hexacell.errors import DeviceError
from hexacell.kinematics.pose import Pose


def pose_difference(one: Pose, other: Pose) -> tuple[float, float]:
    """The largest difference of a position, mm, and of an angle, deg, less full turns."""
    differences = [a - b for a, b in zip(one.as_tuple(), other.as_tuple(), strict=True)]
    angles = [math.remainder(difference, 360.0) for difference in differences[3:]]
    return max(map(abs, differences[:3])), max(map(abs, angles))


def agree(one: Pose, other: Pose, settings: ControllerSettings, tolerances: float = 1.0) -> bool:
    """Whether two poses are the same within so many tolerances of the cell file."""
    position, angle = pose_difference(one, other)
    return (
        position <= tolerances * settings.position_tolerance_mm
        and angle <= tolerances * settings.angle_tolerance_deg
    )


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
