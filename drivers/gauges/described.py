"""Gauges that the cell file describes wholly, so that they need no driver of their own.

The section ``request`` of a gauge says what is asked, which answer is expected, and what a unit of its
number is; ``stream`` has the pattern of lines that a gauge sends by itself, where a group ``channel``
distinguishes several gauges on one port.
"""

from __future__ import annotations

import re
from typing import ClassVar

from drivers.gauges.plausibility import decimals_of
from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, ProtocolSpec, Unit
from drivers.gauges.serial_gauge import SerialGauge, ValueOnlyGauge
from drivers.gauges.streaming import Origin, StreamingGauge
from drivers.serial.framing import LINE_ENDS
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.described_devices import NUMBER, DescribedFrame
from hexacell.cell.devices import GaugeSettings


class _DescribedGauge(SerialGauge):
    """A dial indicator, or what stands in its place, whose frames are ``frame`` of the cell file."""

    probe = None
    protocol: ClassVar[str]
    vendors: ClassVar[str]
    frame: DescribedFrame

    @property
    def spec(self) -> ProtocolSpec:  # type: ignore[override]
        """The protocol, with the example in the cell file."""
        return ProtocolSpec(self.protocol, self.vendors, LineSettings(9600), self.frame.example)

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        text = frame.strip(LINE_ENDS).decode("latin-1")
        if shown := self._shown(text):
            return shown
        if self._is_at_end(text):
            raise self._at_end(f"plunger at its end ({text})")
        raise FrameRejected(frame)

    def _shown(self, text: str) -> DisplayedValue | None:
        match = re.fullmatch(self.frame.answer, text)
        number = match[self.frame.number_group].replace(" ", "") if match else ""
        if not NUMBER.fullmatch(number):
            return None
        decimals = len(number.partition(".")[2]) + decimals_of(self.frame.mm_per_unit)
        return DisplayedValue(float(number) * self.frame.mm_per_unit, decimals, Unit.MM, text)

    def _is_at_end(self, text: str) -> bool:
        at_end = self.frame.at_end
        return at_end is not None and re.fullmatch(at_end, text) is not None


class RequestGauge(_DescribedGauge, ValueOnlyGauge):
    """A gauge by request and answer."""

    protocol, vendors = "request", "gauge by request"

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        example = "request = { ask = ..., answer = ..., example = ... }"
        request = self._described(settings.request, "does not say what is asked and answered", example)
        self.frame = request
        self.terminator = request.ends_with.encode("latin-1")
        self.value_request = request.ask.encode("latin-1")


class StreamGauge(_DescribedGauge, StreamingGauge):
    """A gauge that sends unasked."""

    protocol, vendors = "stream", "gauge that sends"

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        example = "stream = { answer = ..., example = ... }"
        stream = self._described(settings.stream, "does not say what it sends", example)
        self.frame = stream
        self.channel = settings.channel if stream.has_channel else None

    def _origin(self, frame: bytes) -> Origin:
        text = frame.decode("latin-1")
        if self._is_at_end(text):
            return Origin.OWN
        match = re.fullmatch(self.frame.answer, text)
        if match is None:
            return Origin.UNKNOWN
        if self.channel is None:
            return Origin.OWN
        channel = match["channel"]
        if not channel.isdecimal():
            return Origin.UNKNOWN
        return Origin.OWN if int(channel) == self.channel else Origin.ANOTHER_GAUGE
