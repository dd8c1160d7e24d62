"""Where something is measured, and what for: phases, and the keys of sets."""

from enum import StrEnum
from typing import Annotated

from pydantic import AfterValidator

from hexacell.campaign.pilots import pilot_number
from hexacell.cell.fields import Frozen
from hexacell.measurements.csv_file import FEWEST_JOINTS, MOST_JOINTS
from hexacell.measurements.records import Directions

SixNumbers = tuple[float, float, float, float, float, float]
ThreeNumbers = tuple[float, float, float]


def _of_joints(directions: Directions) -> Directions:
    is_of_all = FEWEST_JOINTS <= len(directions) <= MOST_JOINTS
    if directions and not (is_of_all and {-1, 0, 1}.issuperset(directions)):
        raise ValueError("must be 1, -1 or 0 for each joint, or none")
    return directions


ArrivalDirections = Annotated[Directions, AfterValidator(_of_joints)]
"""Whether each joint last moved up, 1, or down, -1; 0 where that is not known; empty: nothing is known."""


class Phase(StrEnum):
    """What a set of poses is measured for; the value begins the keys of its steps."""

    IDENTIFY = "P"
    BEFORE = "before-V"
    AFTER = "after-V"
    CONFIRM = "confirm-V"
    LENGTH = "L"

    @property
    def has_new_geometry(self) -> bool:
        """Whether the held-out poses are commanded with the geometry that is to be verified."""
        return self in {Phase.AFTER, Phase.CONFIRM}


SET_NAMES = {
    Phase.IDENTIFY: "point {}",
    Phase.BEFORE: "held-out point {}, before",
    Phase.AFTER: "held-out point {}, after",
    Phase.CONFIRM: "held-out point {}, again",
    Phase.LENGTH: "length check, mounting {}",
}
STATIONS = {
    Phase.IDENTIFY: "point {}",
    Phase.BEFORE: "held-out point {}",
    Phase.AFTER: "held-out point {} with the new geometry",
    Phase.CONFIRM: "held-out point {} with the new geometry, confirming records",
    Phase.LENGTH: "mounting {}",
}


class SetKey(Frozen):
    """The poses at one point, measured with gauges zeroed once; points count from 1.

    In a length check a point is a mounting of the gauges; all have the zero of the first one.
    """

    phase: Phase
    point: int

    def __str__(self) -> str:
        return f"{self.phase.value}{self.point}"

    @property
    def station(self) -> str:
        """Where the gauges stand, and for what, in words."""
        return STATIONS[self.phase].format(self.point)

    @property
    def seat(self) -> int:
        """The seat, 1 or 2, of a mounting in a length check."""
        return 2 - self.point % 2

    @property
    def name(self) -> str:
        """Display name: ``point 2``, ``held-out point 1, before``."""
        return SET_NAMES[self.phase].format(self.point)

    def pose_name(self, orientation: int) -> str:
        """Display name of a pose: ``point 2, orientation 3``, ``point 1, preliminary pose 2``."""
        pilot = pilot_number(orientation)
        pose = f"orientation {orientation}" if pilot is None else f"preliminary pose {pilot}"
        return f"{self.name}, {pose}"
