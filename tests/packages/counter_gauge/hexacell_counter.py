"""A display counter: ``P?`` asks for its value, ``N?`` for its name.

It answers ``P=+01.2345 mm`` with a carriage return and a line feed; ``P=END`` at an end of its travel.
"""

import re
from typing import ClassVar

from drivers.gauges.protocol import (
    DisplayedValue,
    FrameRejected,
    GaugeState,
    LineSettings,
    ProtocolSpec,
    Unit,
)
from drivers.gauges.serial_gauge import SerialGauge

VALUE = re.compile(rb"P=([+-])(\d\d\.\d{4}) (mm|in)\r")
NAME = re.compile(rb"N=([A-Z0-9]+)\r")
UNITS = {b"mm": Unit.MM, b"in": Unit.INCH}


class CounterGauge(SerialGauge):
    """The counter. What is not here, its base class does: agreement, units, retries, reopening."""

    spec: ClassVar[ProtocolSpec] = ProtocolSpec(
        "counter", "display counter", LineSettings(19200), "P=+01.2345 mm\r\n"
    )
    value_request = b"P?\r"

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if match := VALUE.fullmatch(frame):
            return DisplayedValue.of(match[1], match[2], frame, UNITS[match[3]])
        if frame == b"P=END\r":
            raise self._at_end("plunger at its end (P=END)")
        raise FrameRejected(frame)

    async def _read_state(self) -> GaugeState:
        return GaugeState(identification=await self._query(b"N?\r", _name))


def _name(frame: bytes) -> str:
    match = NAME.fullmatch(frame)
    if match is None:
        raise FrameRejected(frame)
    return match[1].decode("ascii")
