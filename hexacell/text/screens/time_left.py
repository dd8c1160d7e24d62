"""The time that is left of a run: by its own pace, and with the people who place the gauges."""

from itertools import pairwise
from statistics import median

from hexacell.campaign.budget import TimeModel
from hexacell.cell.model import CellSettings
from hexacell.text.layout import duration
from hexacell.text.screens.run_picture import RunPicture
from procedures.calibration.calibration import Mode
from procedures.run.keys import Phase

PACE_RECORDS = 8
"""Number of the latest records whose pace counts."""


def remaining(picture: RunPicture, settings: CellSettings | None) -> str:
    """How long the run still takes, and how many readings that is at most; empty if nothing is known."""
    done, planned = readings(picture)
    if (left := planned - done) <= 0:
        return f"{done} readings so far" if done and planned <= 0 else ""
    minutes = _minutes(picture, settings, left)
    about = "" if minutes is None else f"About {duration(minutes)}, "
    return f"{about}at most {left} readings left"


def readings(picture: RunPicture) -> tuple[int, int]:
    """How many readings are taken, closings of sets included, and how many are planned; 0 if not known."""
    done = sum(len(measured.samples) + measured.closed for measured in picture.state.sets.values())
    return done, picture.described.expected_records if picture.described else 0


def _minutes(picture: RunPicture, settings: CellSettings | None, left: int) -> float | None:
    """By the median of the latest readings, else by what the cell file states; None without either."""
    recent = picture.record_times[-PACE_RECORDS - 1 :]
    gaps = [(later - earlier).total_seconds() / 60.0 for earlier, later in pairwise(recent)]
    if settings is None:
        return left * median(gaps) if gaps else None
    stated = TimeModel.of(settings)
    a_reading = median(gaps) if gaps else stated.record_seconds / 60.0
    return left * a_reading + _stations_left(picture, settings) * stated.point_minutes


def _stations_left(picture: RunPicture, settings: CellSettings) -> int:
    """How often somebody still has to place the gauges in a calibration; 0 in other runs."""
    if picture.described is None or picture.described.mode != Mode.OPTIMISE.value:
        return 0
    begun = picture.state.sets
    points = {phase: len(settings.verification.points) for phase in (Phase.BEFORE, Phase.AFTER)}
    points[Phase.IDENTIFY] = len(settings.identification.points)
    return sum(max(0, points[phase] - sum(at.phase is phase for at in begun)) for phase in points)
