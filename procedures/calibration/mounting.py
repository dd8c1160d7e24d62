"""Whether gauges are mounted as they must be: with room to both sides, and each on its axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from hexacell.cell.devices import GaugeSettings
from hexacell.cell.model import CellSettings
from hexacell.errors import DeviceError, joined
from hexacell.kinematics.rotations import Array
from hexacell.noise.gauge_trial import (
    GaugeMistake,
    TrialFinding,
    judge_response,
    response_of,
)
from hexacell.robot.stated_limits import gauge_travel_of
from procedures.run.steps import ThreeNumbers

MISTAKES: Mapping[GaugeMistake, tuple[str, str, str]] = {
    GaugeMistake.DEAD: (
        "does not follow the ball",
        "do not follow the ball",
        "See whether the plunger touches the ball and is free, and whether the display changes",
    ),
    GaugeMistake.INCHES: (
        "seems to answer in inches",
        "seem to answer in inches",
        "Press the in/mm key; if it answers in mm, see whether its plunger is free",
    ),
    GaugeMistake.EXCHANGED: (
        "answers on another axis",
        "are exchanged",
        "Exchange their cables, or correct port, channel or axis in the cell file and begin a new run",
    ),
    GaugeMistake.REVERSED: (
        "counts the wrong way",
        "count the wrong way",
        "Change the counting direction, or correct sign in the cell file and begin a new run",
    ),
}
"""What each mistake of one gauge and of several is called, and what to do."""


class MountingError(DeviceError):
    """Gauges are not mounted as a set needs them; nothing can be measured with them before they are."""


def require_room(settings: CellSettings, shown_mm: ThreeNumbers) -> None:
    """Refuse gauges whose plungers stand too far from the middle of their travel.

    ``shown_mm`` is what they show along base x, y, z. A gauge whose display does not tell its place passes.

    Raises:
        MountingError: says which gauge must be moved, which way, and how far.
    """
    if errors := list(_without_room(settings, shown_mm)):
        raise joined("the gauges must be mounted again", errors)


def _without_room(settings: CellSettings, shown_mm: ThreeNumbers) -> Iterator[MountingError]:
    travel = gauge_travel_of(settings)
    room, needed = travel.room(shown_mm), travel.sure_room
    gauges = sorted(settings.gauges, key=lambda gauge: gauge.axis)
    for axis, (gauge, place) in enumerate(zip(gauges, travel.places(shown_mm), strict=True)):
        if place is None or abs(place) <= settings.stations.mounting_mm:
            continue
        left = room.upper[axis] if place > 0.0 else -room.lower[axis]
        yield _off_the_middle(gauge, place, max(0.0, left), needed.upper[axis])


def _off_the_middle(gauge: GaugeSettings, place: float, left_mm: float, needed_mm: float) -> MountingError:
    side = f"{'+' if place > 0.0 else '-'}{gauge.axis}"
    return MountingError(
        f"its plunger stands {abs(place):.1f} mm from the middle of its travel: {left_mm:.1f} mm are left "
        f"towards {side}, where {needed_mm:g} are needed",
        subject=f"gauge {gauge.name}",
        action=f"Move the gauge by {abs(place):.1f} mm along {side}, or correct its middle_mm",
    )


def require_response(settings: CellSettings, moved_mm: Array, shown_mm: Array) -> Array:
    """What each gauge showed per length of a move along each axis (3, 3), by gauge and axis.

    ``moved_mm`` (3, 3) are the moves in rows, ``shown_mm`` (3, 3) what the gauges x, y, z showed of them.

    Raises:
        MountingError: names the gauges that do not follow the ball as they should, and what to do.
    """
    response = response_of(moved_mm, shown_mm)
    if findings := judge_response(response):
        gauges = sorted(settings.gauges, key=lambda gauge: gauge.axis)
        errors = [_mistake(finding, gauges, response) for finding in findings]
        raise joined("the gauges do not answer as they are mounted by the cell file", errors)
    return response


def _mistake(finding: TrialFinding, gauges: Sequence[GaugeSettings], response: Array) -> MountingError:
    """What is wrong with some gauges, what they showed, and what to do."""
    named = [gauges[number] for number in finding.gauges]
    of_one, of_several, action = MISTAKES[finding.mistake]
    problem = of_several if len(named) > 1 else of_one
    shown = "; ".join(f"{gauges[n].name} showed {_numbers(response[n])}" for n in finding.gauges)
    return MountingError(
        f"{problem}: while the ball moved by 1 mm along x, y and z in turn, {shown} mm",
        subject=f"gauge{'s' if len(named) > 1 else ''} {', '.join(gauge.name for gauge in named)}",
        action=action,
    )


def _numbers(row: Array) -> str:
    return ", ".join(f"{value:+.3f}" for value in row)
