"""A gauge that sends numbers by itself, described wholly in the cell file.

The section ``stream`` of the gauge has the pattern of its lines. A group ``channel`` in it tells several
gauges on one port apart.
"""

from __future__ import annotations

import re

from drivers.gauges.described_value import described_value, is_at_end
from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, ProtocolSpec
from drivers.gauges.streaming import Origin, StreamingGauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import FileError


class StreamGauge(StreamingGauge):
    """A dial indicator, or what stands in its place, that sends unasked."""

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        if settings.stream is None:
            raise FileError(
                "does not say what it sends",
                subject=self.subject,
                action="Add stream = { answer = ..., example = ... } to the gauge",
            )
        self._described = settings.stream
        self.channel = settings.channel if self._described.has_channel else None
        self._spec = ProtocolSpec("stream", "gauge that sends", LineSettings(9600), self._described.example)

    @property
    def spec(self) -> ProtocolSpec:  # type: ignore[override]
        """As the cell file describes it."""
        return self._spec

    def _origin(self, frame: bytes) -> Origin:
        text = frame.decode("latin-1")
        if is_at_end(text, self._described):
            return Origin.OWN
        match = re.fullmatch(self._described.answer, text)
        if match is None:
            return Origin.UNKNOWN
        if self.channel is None:
            return Origin.OWN
        channel = match["channel"]
        if not channel.isdecimal():
            return Origin.UNKNOWN
        return Origin.OWN if int(channel) == self.channel else Origin.ANOTHER_GAUGE

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        text = frame.decode("latin-1")
        if shown := described_value(text, self._described):
            return shown
        if is_at_end(text, self._described):
            raise self._at_end(f"plunger at its end ({text})")
        raise FrameRejected(frame)
