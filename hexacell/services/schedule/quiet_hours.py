"""Quiet hours: whether a moment lies in them, and how long it is until they begin."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta

from hexacell.cell.unattended import UnattendedSettings

WEEKDAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")
DAYS_AHEAD = 8


def quiet_until(settings: UnattendedSettings, at: datetime) -> datetime | None:
    """When the quiet hours end in which a moment lies; none if it lies in none.

    Where one ends as another begins, the end of the latter.
    """
    end: datetime | None = None
    for begin, until in sorted(_spans(settings, at)):
        if begin <= (end or at) < until:
            end = until
    return end


def next_quiet(settings: UnattendedSettings, at: datetime) -> datetime | None:
    """When quiet hours begin after a moment; the moment itself if it lies in some; none without any."""
    if quiet_until(settings, at) is not None:
        return at
    return min((begin for begin, _ in _spans(settings, at) if begin > at), default=None)


def _spans(settings: UnattendedSettings, at: datetime) -> Iterator[tuple[datetime, datetime]]:
    """Begin and end of all from the day before a moment to a week after it, in its time zone."""
    midnight = at.replace(hour=0, minute=0, second=0, microsecond=0)
    for number in range(-1, DAYS_AHEAD):
        day = midnight + timedelta(days=number)
        if WEEKDAYS[day.weekday()] in settings.quiet_days:
            for begin, length in settings.quiet_spans:
                start = day + timedelta(minutes=begin)
                yield start, start + timedelta(minutes=length)
