"""The value in a frame that the cell file describes by a pattern."""

from __future__ import annotations

import re

from drivers.gauges.plausibility import decimals_of
from drivers.gauges.protocol import DisplayedValue, Unit
from hexacell.cell.described_devices import NUMBER, DescribedFrame


def described_value(text: str, described: DescribedFrame) -> DisplayedValue | None:
    """The value, mm, in a frame without line ends; none if it is no such frame, or without a number."""
    match = re.fullmatch(described.answer, text)
    if match is None:
        return None
    number = match[described.number_group].replace(" ", "")
    if not NUMBER.fullmatch(number):
        return None
    decimals = len(number.partition(".")[2]) + decimals_of(described.mm_per_unit)
    return DisplayedValue(float(number) * described.mm_per_unit, decimals, Unit.MM, text)


def is_at_end(text: str, described: DescribedFrame) -> bool:
    """Whether the frame says that the plunger is at an end of its travel."""
    return described.at_end is not None and re.fullmatch(described.at_end, text) is not None
