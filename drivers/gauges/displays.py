"""Instruments, displays and receivers that give nothing but the displayed value, one protocol a class."""

from __future__ import annotations

import re

from drivers.errors import EmptyChannel, WrongSetting
from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, Probe, ProtocolSpec, Unit
from drivers.gauges.serial_gauge import ValueOnlyGauge
from drivers.gauges.streaming import Origin, StreamingGauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError

ID_H_VALUE = re.compile(rb"G([NXMW])(\d\d),([+-])(\d{1,4}\.\d{2,6})\r")
PEAK_MODES = {b"X": "maximum", b"M": "minimum", b"W": "run-out"}


class IdHGauge(ValueOnlyGauge):
    """A Mitutoyo ID-H with RS-232C; several may be chained: ``channel`` is the number that is set in it.

    ``GA`` and the number request the displayed value; the answer is ``GN`` (or ``GX``, ``GM``, ``GW`` in
    the peak modes), the number, a comma, sign, four digits, point and decimals, carriage return and line
    feed (ID-H manual 99MAH016B, page 4-5). An inch display has five decimals.
    """

    spec = ProtocolSpec("mitutoyo-id-h", "Mitutoyo ID-H", LineSettings(9600), "GN01,+0016.2345\r\n")
    has_channels = True

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


DIGIMATIC_VALUE = re.compile(rb"([+-]?)(\d{1,5}\.\d{1,6})\r?\n")
DIGIMATIC_ERROR = re.compile(rb"# *([ -~]*)\r?\n")


class DigimaticUsbGauge(ValueOnlyGauge):
    """A Digimatic indicator behind a microcontroller on USB: any line asks, a bare number answers.

    The number is in the unit of the instrument, which is not sent; a line that begins with ``#`` is an
    error. So do open designs of such adapters (apirek/digimatic on GitHub). A USB port has no baud rate or
    parity.
    """

    spec = ProtocolSpec("digimatic-usb", "Digimatic by microcontroller", LineSettings(115200), "-1.234\n")
    value_request = b"\n"
    terminator = b"\n"

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if match := DIGIMATIC_VALUE.fullmatch(frame):
            return DisplayedValue.of(match[1], match[2], frame)
        if error := DIGIMATIC_ERROR.fullmatch(frame):
            problem = f"its adapter reports: {error[1].decode('ascii')}"
            raise self._error(DeviceError, problem, "Switch the indicator on and check its cable")
        raise FrameRejected(frame)


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
        match = HEIDENHAIN_VALUE.fullmatch(frame)
        if match is None:
            raise FrameRejected(frame)
        if match[3] == b"?":
            raise self._voided(f"has lost the signal of its probe ({match[0].decode('ascii').strip()})")
        if match[4] not in ACTUAL_VALUE:
            problem = f"shows a result of a series of measurements ({match[4].decode('ascii')})"
            raise self._error(WrongSetting, problem, "Set it to the actual value")
        return DisplayedValue.of(match[1], match[2], frame, Unit.INCH if match[3] == b'"' else Unit.MM)


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
        match = KEYENCE_VALUES.fullmatch(frame)
        if match is None:
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
        match = UWAVE_VALUE.fullmatch(frame)
        if match is None:
            raise FrameRejected(frame)
        return DisplayedValue.of(match[2], match[3], frame, UWAVE_UNITS[match[4]])
