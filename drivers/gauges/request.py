"""A gauge that answers a request with a number, described wholly in the cell file.

The section ``request`` of the gauge says what is asked, which answer is expected, and what a unit of its
number is. So a display counter or an amplifier with a serial line needs no driver of its own.
"""

from __future__ import annotations

from drivers.gauges.described_value import described_value, is_at_end
from drivers.gauges.protocol import (
    DisplayedValue,
    FrameRejected,
    LineSettings,
    ProtocolSpec,
)
from drivers.gauges.value_only import ValueOnlyGauge
from drivers.serial.framing import LINE_ENDS
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import FileError


class RequestGauge(ValueOnlyGauge):
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
        if shown := described_value(text, self._request):
            return shown
        if is_at_end(text, self._request):
            raise self._at_end(f"plunger at its end ({text})")
        raise FrameRejected(frame)
