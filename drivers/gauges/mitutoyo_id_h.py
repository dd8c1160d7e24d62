"""Mitutoyo ID-H indicators with RS-232C."""

import re

from drivers.errors import WrongSetting
from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, ProtocolSpec
from drivers.gauges.serial_gauge import ValueOnlyGauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings

ID_H_VALUE = re.compile(rb"G([NXMW])(\d\d),([+-])(\d{1,4}\.\d{2,6})\r")
PEAK_MODES = {b"X": "maximum", b"M": "minimum", b"W": "run-out"}


class IdHGauge(ValueOnlyGauge):
    """A Mitutoyo ID-H with RS-232C; several may be chained: ``channel`` is the number that is set in it.

    ``GA`` and the number request the displayed value; the answer is ``GN`` (or ``GX``, ``GM``, ``GW`` in
    the peak modes), the number, a comma, sign, four digits, point and decimals, carriage return and line
    feed (ID-H manual 99MAH016B, page 4-5). An inch display has five decimals.
    """

    spec = ProtocolSpec("mitutoyo-id-h", "Mitutoyo ID-H", LineSettings(9600), "GN01,+0016.2345\r\n", 5)
    has_channels = True
    silence_check = "protocol, and channel, the number that is set in it,"

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        self.value_request = b"GA%02d\r\n" % settings.channel

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        match = ID_H_VALUE.fullmatch(frame)
        if match is None or int(match[2]) != self.channel:
            raise FrameRejected(frame)
        if mode := PEAK_MODES.get(match[1]):
            raise self._error(WrongSetting, f"shows its {mode}", "Set it to normal measuring")
        return DisplayedValue.of(match[3], match[4], frame)
