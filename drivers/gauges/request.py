"""A gauge that answers a request with a number, described wholly in the cell file.

The section ``request`` of the gauge says what is asked, which answer is expected, and what a unit of its
number is. So a display counter or an amplifier with a serial line needs no driver of its own.
"""

from __future__ import annotations

import re

from drivers.errors import GaugeAtEnd
from drivers.gauges.plausibility import decimals_of
from drivers.gauges.protocol import (
    DisplayedValue,
    FrameRejected,
    GaugeState,
    LineSettings,
    ProtocolSpec,
    Unit,
)
from drivers.gauges.serial_gauge import SerialGauge
from drivers.serial.framing import LINE_ENDS
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import NUMBER, GaugeSettings
from hexacell.errors import FileError


class RequestGauge(SerialGauge):
    """A dial indicator, or what stands in its place, by request and answer."""

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        if settings.request is None:
            raise FileError(
                "does not say what is asked and answered",
                subject=self.subject,
                action="Add request = { ask = ..., answer = ..., example = ... } to the gauge",
            )
        self._request = settings.request
        self.terminator = self._request.ends_with.encode("latin-1")
        self.value_request = self._request.ask.encode("latin-1")
        self._spec = ProtocolSpec("request", "gauge by request", LineSettings(9600), self._request.example)

    @property
    def spec(self) -> ProtocolSpec:  # type: ignore[override]
        """As the cell file describes it."""
        return self._spec

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        text = frame.strip(LINE_ENDS).decode("latin-1")
        if match := re.fullmatch(self._request.answer, text):
            return self._value(match[1].replace(" ", ""), text)
        if self._request.at_end is not None and re.fullmatch(self._request.at_end, text):
            raise self._at_end(f"plunger at its end ({text})")
        raise FrameRejected(frame)

    def _value(self, number: str, text: str) -> DisplayedValue:
        """The value, mm; a pattern that takes anything may have taken no number."""
        if not NUMBER.fullmatch(number):
            raise FrameRejected(text.encode("latin-1"))
        unit_mm = self._request.mm_per_unit
        decimals = len(number.partition(".")[2]) + decimals_of(unit_mm)
        return DisplayedValue(float(number) * unit_mm, decimals, Unit.MM, text)

    async def _read_state(self) -> GaugeState:
        # decimals only: it has no other setting that can be asked for
        try:
            return GaugeState(decimals=(await self._read_value()).decimals)
        except GaugeAtEnd:
            return GaugeState()
