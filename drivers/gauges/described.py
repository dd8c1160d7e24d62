"""The value in a frame that the cell file describes by a pattern."""

from __future__ import annotations

import re

from drivers.gauges.plausibility import decimals_of
from drivers.gauges.protocol import (
    DisplayedValue,
    FrameRejected,
    LineSettings,
    ProtocolSpec,
    Unit,
)
from drivers.gauges.serial_gauge import ValueOnlyGauge
from drivers.gauges.streaming import Origin, StreamingGauge
from drivers.serial.framing import LINE_ENDS
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.described_devices import NUMBER, DescribedFrame
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import FileError


def described_value(text: str, described: DescribedFrame) -> DisplayedValue | None:
    """The value, mm, in a frame without line ends; none if it is no such frame, or without a number."""
    match = re.fullmatch(described.answer, text)
    if match is None:
        return None
    number = match[described.number_group].replace(" ", "")
    if not NUMBER.fullmatch(number):
        return None
    decimals = len(number.partition(".")[2]) + decimals_of(described.mm_per_unit)
    return DisplayedValue(float(number) * described.mm_per_unit, decimals, Unit.MM, text)


def is_at_end(text: str, described: DescribedFrame) -> bool:
    """Whether the frame says that the plunger is at an end of its travel."""
    return described.at_end is not None and re.fullmatch(described.at_end, text) is not None


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
