"""Digimatic indicators behind a microcontroller on USB."""

import re

from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, Probe, ProtocolSpec
from drivers.gauges.serial_gauge import ValueOnlyGauge
from hexacell.errors import DeviceError

DIGIMATIC_VALUE = re.compile(rb"([+-]?)(\d{1,5}\.\d{1,6})\r?\n")
DIGIMATIC_ERROR = re.compile(rb"# *([ -~]*)\r?\n")


class DigimaticUsbGauge(ValueOnlyGauge):
    """A Digimatic indicator behind a microcontroller on USB: any line asks, a bare number answers.

    The number is in the unit of the instrument, which is not sent; a line that begins with ``#`` is an
    error. So do open designs of such adapters (apirek/digimatic on GitHub). A USB port has no baud rate or
    parity.
    """

    spec = ProtocolSpec("digimatic-usb", "Digimatic by microcontroller", LineSettings(115200), "-1.234\n")
    probe = Probe(restarts=True)
    value_request = b"\n"
    terminator = b"\n"

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if match := DIGIMATIC_VALUE.fullmatch(frame):
            return DisplayedValue.of(match[1], match[2], frame)
        if error := DIGIMATIC_ERROR.fullmatch(frame):
            problem = f"its adapter reports: {error[1].decode('ascii')}"
            raise self._error(DeviceError, problem, "Switch the indicator on and check its cable")
        raise FrameRejected(frame)
