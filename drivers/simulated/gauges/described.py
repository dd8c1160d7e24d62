"""Simulated gauges that the cell file describes: they send their example, with other numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import ClassVar

from drivers.simulated.gauges.instruments import MM_PER_INCH, Indicator, Instrument, SingleIndicator
from hexacell.cell.described_devices import DescribedFrame, RequestSettings, StreamSettings, VisaSettings

SOCKET = re.compile(r"socket://([\w.]+):(\d+)")


class ByRequest(SingleIndicator):
    """One that is asked."""

    at_end: ClassVar[bytes] = b"ERROR\r\n"

    def __init__(self, indicators: Mapping[int, Indicator], request: RequestSettings) -> None:
        super().__init__(indicators)
        self._asked = request.ask.encode("latin-1")
        self._template = _Template(request)

    def split(self, received: bytes) -> tuple[list[bytes], bytes]:
        """What it is asked need not end like a line: it may be one control character."""
        *before, rest = received.split(self._asked)
        return [self._asked.rstrip(b"\r\n") for _ in before], rest[-len(self._asked) :]

    def answer(self, command: bytes) -> bytes:
        """The value; commands come without their line end."""
        if not self.indicator.powered or command != self._asked.rstrip(b"\r\n"):
            return b""
        shown = self.indicator.shown()
        return self.at_end if shown is None else self._template.filled(shown, 1)


class Streaming(Instrument):
    """One that sends by itself, or several behind one receiver."""

    period_s: ClassVar[float | None] = 0.05

    def __init__(self, indicators: Mapping[int, Indicator], described: StreamSettings) -> None:
        super().__init__(indicators)
        self._template = _Template(described)

    def _value(self, channel: int) -> bytes:
        shown = self.indicators[channel].shown()
        return self.at_end if shown is None else self._template.filled(shown, channel)


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
        return b"%+.8E\n" % (mm / self._settings.mm_per_unit)

    @classmethod
    def address(cls, url: str) -> str:
        if match := SOCKET.fullmatch(url):
            return f"TCPIP::{match[1]}::{match[2]}::SOCKET"
        return f"ASRL{url}::INSTR"


class _Template:
    """The example of a frame, whose number and channel are others."""

    def __init__(self, described: DescribedFrame) -> None:
        match = re.fullmatch(described.answer, described.example.strip("\r\n"))
        if match is None:
            raise ValueError(described.example)
        self._example, self._mm_per_unit = described.example, described.mm_per_unit
        self._number = match.span(described.number_group)
        self._channel = match.span("channel") if "channel" in match.groupdict() else None

    def filled(self, mm: float, channel: int) -> bytes:
        """The frame of a value."""
        shown = self._example[slice(*self._number)]
        decimals = len(shown.partition(".")[2])
        parts = [(self._number, f"{mm / self._mm_per_unit:+0{len(shown)}.{decimals}f}")]
        if self._channel is not None:
            width = self._channel[1] - self._channel[0]
            parts.append((self._channel, f"{channel:0{width}d}"))
        text = self._example
        for (start, end), part in sorted(parts, reverse=True):
            text = text[:start] + part + text[end:]
        return text.encode("latin-1")
