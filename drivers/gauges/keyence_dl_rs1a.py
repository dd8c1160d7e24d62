"""Keyence GT2 probes behind a DL-RS1A."""

import re

from drivers.errors import EmptyChannel
from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, ProtocolSpec, Unit
from drivers.gauges.serial_gauge import ValueOnlyGauge
from hexacell.errors import DeviceError

KEYENCE_VALUES = re.compile(rb"M0((?:,[+-]\d{3}\.\d{1,4}){1,15})\r")
KEYENCE_ERROR = re.compile(rb"ER,M0,(\d\d)\r")
LARGEST_MM = 200.0


class KeyenceGauge(ValueOnlyGauge):
    """A Keyence GT2 probe whose amplifier shares a DL-RS1A; ``channel`` is 1 for the amplifier 00.

    Line 9600 8N1 as delivered. ``M0`` requests all values at once: ``M0``, then a comma, sign, three
    digits, point and decimals in mm for each amplifier from number 00 on, carriage return and line feed;
    ``ER,M0,nn`` is an error (DL-RS1A manual, pages 9 to 15). Values are within 199.9999; others mean none.
    """

    spec = ProtocolSpec(
        "keyence-dl-rs1a", "Keyence DL-RS1A", LineSettings(9600), "M0,+001.2345,-000.0010\r\n"
    )
    probe = None  # the question stops machines: it is a G code
    has_channels = True
    value_request = b"M0\r\n"

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if error := KEYENCE_ERROR.fullmatch(frame):
            problem = f"reports error {error[1].decode('ascii')} instead of its value"
            raise self._error(DeviceError, problem, "Look it up in the manual of the DL-RS1A")
        if (match := KEYENCE_VALUES.fullmatch(frame)) is None:
            raise FrameRejected(frame)
        values, place = match[1].split(b",")[1:], self.settings.channel
        if not 1 <= place <= len(values):
            action = "Correct channel in the cell file: 1 for the amplifier 00"
            raise self._error(
                EmptyChannel, f"has channel {place}, where {len(values)} amplifiers answer", action
            )
        value = values[place - 1]
        shown = DisplayedValue.of(value[:1], value[1:], value, Unit.MM)
        if abs(shown.value) >= LARGEST_MM:
            raise self._at_end(f"shows {shown.text}, no value, as at an end of its travel")
        return shown
