"""The section of the cell file on runs without a person: when they begin, and how long they last."""

from __future__ import annotations

import re
from typing import Literal

from pydantic import Field, field_validator

from hexacell.cell.fields import NotNegative, Positive, Section, Text, broken_rule

DAY_MINUTES = 24 * 60
_SPAN = re.compile(r"([01]\d|2[0-3]):([0-5]\d)-([01]\d|2[0-3]):([0-5]\d)")

Weekday = Literal["mon", "tue", "wed", "thu", "fri", "sat", "sun"]


class UnattendedSettings(Section):
    """Runs without a person: check, quick level or calibration, from a schedule or typed."""

    quiet_hours: tuple[Text, ...] = Field(
        (),
        max_length=20,
        description="when none may begin and one that goes on ends, as 05:30-22:00, in the computer's time "
        "zone; past midnight as 22:00-06:00",
    )
    quiet_days: tuple[Weekday, ...] = Field(
        ("mon", "tue", "wed", "thu", "fri", "sat", "sun"),
        description="on which quiet hours begin",
    )
    window_minutes: NotNegative = Field(
        0.0,
        le=DAY_MINUTES,
        description="so long after its time a run that could not begin is tried again; 0: not at all",
    )
    retry_minutes: Positive = Field(10.0, le=DAY_MINUTES, description="between two tries")
    longest_minutes: Positive | None = Field(
        None,
        description="a run that lasts longer goes back to its reference and ends; it can be resumed",
    )

    @field_validator("quiet_hours")
    @classmethod
    def _are_spans_of_a_day(cls, spans: tuple[str, ...]) -> tuple[str, ...]:
        for span in spans:
            if _SPAN.fullmatch(span) is None or span[:5] == span[6:]:
                raise broken_rule(f"'{span}' is no span of a day", "Write it as 05:30-22:00")
        return spans

    @property
    def quiet_spans(self) -> tuple[tuple[int, int], ...]:
        """Begin and length of the quiet hours, minutes, from midnight."""
        found = (_SPAN.fullmatch(span) for span in self.quiet_hours)
        clocks = [tuple(int(number) for number in one.groups()) for one in found if one is not None]
        begins_ends = [(60 * a + b, 60 * c + d) for a, b, c, d in clocks]
        return tuple((begin, (end - begin) % DAY_MINUTES) for begin, end in begins_ends)
