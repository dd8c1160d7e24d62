"""Length gauges behind a Heidenhain ND display unit."""

import re

from drivers.errors import WrongSetting
from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, Probe, ProtocolSpec, Unit
from drivers.gauges.serial_gauge import ValueOnlyGauge

HEIDENHAIN_VALUE = re.compile(rb"([+\- ])(?=.{9}\d )( *\d+\.\d+) ([ \"?])[<>=? ]?([SAGD ]?) {0,2}\r")
ACTUAL_VALUE = {b"", b" ", b"A"}


class HeidenhainGauge(ValueOnlyGauge):
    """A length gauge behind a Heidenhain ND display unit (ND 221, 231, 281 and their like).

    Line 9600 7E2. The character STX requests the value: sign, ten characters of blanks, digits and point, a
    blank, the unit (blank for mm, ``"`` for inch, ``?`` for a fault), sorting and series status, carriage
    return and line feed (ND 281B manual, page 47). The display may be set to add blank lines.
    """

    spec = ProtocolSpec(
        "heidenhain-nd", "Heidenhain ND", LineSettings(9600, 7, "E", 2), "-      5.23  =A\r\n"
    )
    probe = Probe(is_last=True)  # others add STX to the question after it
    value_request = b"\x02"

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if (match := HEIDENHAIN_VALUE.fullmatch(frame)) is None:
            raise FrameRejected(frame)
        if match[3] == b"?":
            raise self._voided(f"has lost the signal of its probe ({match[0].decode('ascii').strip()})")
        if match[4] not in ACTUAL_VALUE:
            problem = f"shows a result of a series of measurements ({match[4].decode('ascii')})"
            raise self._error(WrongSetting, problem, "Set it to the actual value")
        return DisplayedValue.of(match[1], match[2], frame, Unit.INCH if match[3] == b'"' else Unit.MM)
