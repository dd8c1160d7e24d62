"""A simulated instrument with SCPI: a conditioner with several inputs, or an interferometer."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import ClassVar

from drivers.simulated.gauges.indicator import MM_PER_INCH, Indicator
from drivers.simulated.gauges.instruments import Instrument
from hexacell.cell.described_devices import VisaSettings

SOCKET = re.compile(r"socket://([\w.]+):(\d+)")


class Scpi(Instrument):
    """Answers in exponential notation; another unit than it is to have shows in its settings."""

    command_end: ClassVar[bytes] = b"\n"
    at_end: ClassVar[bytes] = b"+9.90000000E+37\n"

    def __init__(self, indicators: Mapping[int, Indicator], settings: VisaSettings) -> None:
        super().__init__(indicators)
        self._settings = settings
        self._values = {settings.question(channel): channel for channel in self.indicators}

    def answer(self, command: bytes) -> bytes:
        """A value, a setting, or its name; nothing to what it does not know."""
        asked = command.decode("latin-1")
        indicator = self.indicators[self._values.get(asked, min(self.indicators))]
        if not indicator.powered:
            return b""
        if asked in self._values:
            return self._value(self._values[asked])
        if asked == "*IDN?":
            return b"HEXACELL,SIMULATED,0,1\n"
        if asked in self._settings.expect:
            changed = any(one.inch for one in self.indicators.values())
            return (b"OTHER" if changed else self._settings.expect[asked].encode("latin-1")) + b"\n"
        return b""

    def _value(self, channel: int) -> bytes:
        shown = self.indicators[channel].shown()
        if shown is None:
            return self.at_end
        mm = shown * MM_PER_INCH if self.indicators[channel].inch else shown
        return self.format_value(channel, mm / self._settings.mm_per_unit, inch=False)

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        """Nine digits."""
        del inch
        return b"%+.8E\n" % value


def visa_resource(url: str) -> str:
    """The VISA resource of a simulated line."""
    if match := SOCKET.fullmatch(url):
        return f"TCPIP::{match[1]}::{match[2]}::SOCKET"
    return f"ASRL{url}::INSTR"
