"""Dial indicators with a Mitutoyo U-WAVE transmitter."""

import re

from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, Probe, ProtocolSpec, Unit
from drivers.gauges.streaming import Origin, StreamingGauge

UWAVE_VALUE = re.compile(rb"DT1(\d{4})([+-])(?=.{11}[MI])(\d+\.\d+)([MI])")
UWAVE_HEADER = re.compile(rb"DT1(\d{4})")
UWAVE_STATUS = re.compile(rb"(ST|TI|RI)\d[ -~]*")
UWAVE_UNITS = {b"M": Unit.MM, b"I": Unit.INCH}


def channel_of(frame: bytes) -> int | None:
    """The channel whose value a frame is; None if it is no value, to the last byte."""
    match = UWAVE_VALUE.fullmatch(frame)
    return None if match is None else int(match[1])


class UwaveGauge(StreamingGauge):
    """A dial indicator with a Mitutoyo U-WAVE transmitter; its ``channel`` is 203 for the digits 0203.

    Line 57600 8N1 of the receiver U-WAVE-R. Each transmitter sends ``DT1``, four digits (its group and
    channel), sign, eleven characters of digits and point, and ``M`` or ``I`` for mm or inch, with a
    carriage return; lines that begin with ``ST`` or ``TI`` are about transmitters (two drivers of others
    with captured frames, ``DT10002-0000000.001M``). A transmitter sends when its key is pressed, or by
    itself if its event-driven mode is on.
    """

    spec = ProtocolSpec("uwave", "Mitutoyo U-WAVE", LineSettings(57600), "DT10002-0000000.001M\r")
    probe = Probe(channel_of=channel_of)
    has_channels = True
    usual_delay_s = 0.5  # its radio, and the transmitter's own interval

    def _origin(self, frame: bytes) -> Origin:
        if header := UWAVE_HEADER.match(frame):
            return Origin.OWN if int(header[1]) == self.channel else Origin.ANOTHER_GAUGE
        return Origin.STATUS if UWAVE_STATUS.fullmatch(frame) else Origin.UNKNOWN

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if (match := UWAVE_VALUE.fullmatch(frame)) is None:
            raise FrameRejected(frame)
        return DisplayedValue.of(match[2], match[3], frame, UWAVE_UNITS[match[4]])
