"""Quiet hours: over midnight, on some days, one after the other, and none."""

from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hexacell.cell.operation import UnattendedSettings
from hexacell.services.unattended.unattended_runs import next_quiet, quiet_until

MONDAY = datetime(2026, 3, 2, tzinfo=UTC)


def at(clock: str, day: int = 0) -> datetime:
    hours, minutes = map(int, clock.split(":"))
    return MONDAY + timedelta(days=day, hours=hours, minutes=minutes)


def quiet(*spans: str, **changes: object) -> UnattendedSettings:
    return UnattendedSettings.model_validate({"quiet_hours": spans, **changes})


def test_a_span_may_go_past_midnight_and_one_that_follows_at_once_goes_on() -> None:
    nights = quiet("22:00-06:00")
    assert quiet_until(nights, at("23:30")) == at("06:00", 1)
    assert quiet_until(nights, at("05:59")) == at("06:00")
    assert quiet_until(nights, at("06:00")) is None
    assert quiet_until(quiet("06:00-14:00", "14:00-22:00"), at("07:00")) == at("22:00")


def test_days_are_those_on_which_they_begin_and_without_quiet_hours_there_are_none() -> None:
    friday = quiet("22:00-06:00", quiet_days=("fri",))
    assert quiet_until(friday, at("23:00")) is None
    assert quiet_until(friday, at("23:00", 4)) == at("06:00", 5)
    assert quiet_until(friday, at("05:00", 5)) == at("06:00", 5)
    assert next_quiet(friday, at("12:00")) == at("22:00", 4)
    assert quiet_until(quiet(), MONDAY) is None
    assert next_quiet(quiet(), MONDAY) is None
    assert next_quiet(quiet("05:30-22:00", quiet_days=()), MONDAY) is None


@given(st.integers(0, 1439), st.integers(1, 1439), st.integers(0, 6 * 1440))
def test_they_end_at_their_end_and_begin_at_their_begin(begin, length, minute) -> None:
    end = (begin + length) % 1440
    stated = quiet(f"{begin // 60:02}:{begin % 60:02}-{end // 60:02}:{end % 60:02}")
    now = MONDAY + timedelta(minutes=minute)
    since = (minute - begin) % 1440
    assert (quiet_until(stated, now) is not None) == (since < length)
    following = next_quiet(stated, now)
    assert following is not None
    assert following - now == (timedelta(0) if since < length else timedelta(minutes=1440 - since))


def test_what_is_no_span_is_refused() -> None:
    for span in ("5:30-22:00", "05:30-24:00", "05:30", "05:30-05:30", "at night"):
        with pytest.raises(ValidationError, match="is no span of a day"):
            quiet(span)
