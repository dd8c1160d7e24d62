"""Simulated gauges that the cell file describes: frames like their example, SCPI, Modbus RTU."""

import re
import struct
from collections.abc import Mapping
from typing import ClassVar

from drivers.gauges.described import FORMATS
from drivers.simulated.gauges.instruments import MM_PER_INCH, Indicator, Instrument, SingleIndicator
from hexacell.cell.described_devices import (
    DescribedFrame,
    ModbusSettings,
    RequestSettings,
    StreamSettings,
    VisaSettings,
)

SOCKET = re.compile(r"socket://([\w.]+):(\d+)")
REQUEST_BYTES = 8
ILLEGAL_ADDRESS = 2
POLYNOMIAL = 0xA001
WRITE_REGISTER = 6


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
        end = described.ends_with or ""
        self._end = b"" if described.example.endswith(end) else end.encode("latin-1")

    def _value(self, channel: int) -> bytes:
        shown = self.indicators[channel].shown()
        return self.at_end if shown is None else self._template.filled(shown, channel) + self._end


class Scpi(Instrument):
    """Answers in exponential notation; another unit than it is to have shows in its settings."""

    command_end: ClassVar[bytes] = b"\n"
    at_end: ClassVar[bytes] = b"+9.90000000E+37\n"

    def __init__(self, indicators: Mapping[int, Indicator], settings: VisaSettings) -> None:
        super().__init__(indicators)
        self._settings = settings
        self.command_end = settings.line_end.encode("latin-1")  # type: ignore[misc]
        self._values = {settings.question(channel): channel for channel in self.indicators}

    def answer(self, command: bytes) -> bytes:
        """A value, a setting, or its name; nothing to what it does not know."""
        asked, said = command.decode("latin-1"), b""
        if not self.indicators[self._values.get(asked, min(self.indicators))].powered:
            return b""
        if asked in self._values:
            said = self._value(self._values[asked])
        elif asked == "*IDN?":
            said = b"HEXACELL,SIMULATED,0,1\n"
        elif asked in self._settings.expect:
            changed = any(one.inch for one in self.indicators.values())
            said = (b"OTHER" if changed else self._settings.expect[asked].encode("latin-1")) + b"\n"
        return said.replace(b"\n", self.command_end)

    def format_value(self, _channel: int, value: float, *, inch: bool) -> bytes:
        mm = value * MM_PER_INCH if inch else value
        return b"%+.8E\n" % (mm / self._settings.mm_per_unit)

    @classmethod
    def address(cls, url: str) -> str:
        if match := SOCKET.fullmatch(url):
            return f"TCPIP::{match[1]}::{match[2]}::SOCKET"
        return f"ASRL{url}::INSTR"


class _Template:
    """The example of a frame, whose number and channel are others."""

    def __init__(self, described: DescribedFrame) -> None:
        if (match := re.fullmatch(described.answer, described.bare_example)) is None:
            raise ValueError(described.example)
        self._example, self._mm_per_unit = described.example, described.mm_per_unit
        self._number = match.span(described.number_group)
        self._channel = match.span("channel") if "channel" in match.groupdict() else None

    def filled(self, mm: float, channel: int) -> bytes:
        """The frame of a value."""
        shown = self._example[slice(*self._number)]
        mantissa, exponent, _ = shown.upper().partition("E")
        decimals = len(mantissa.partition(".")[2])
        parts = [(self._number, f"{mm / self._mm_per_unit:+0{len(shown)}.{decimals}{exponent or 'f'}}")]
        if self._channel is not None:
            width = self._channel[1] - self._channel[0]
            parts.append((self._channel, f"{channel:0{width}d}"))
        text = self._example
        for (start, end), part in sorted(parts, reverse=True):
            text = text[:start] + part + text[end:]
        return text.encode("latin-1")


def crc(data: bytes) -> bytes:
    """CRC-16 of the Modbus over Serial Line specification, 2.5.1.2: low byte first."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ POLYNOMIAL if register & 1 else register >> 1
    return struct.pack("<H", register)


def split_requests(received: bytes) -> tuple[list[bytes], bytes]:
    """Whole requests with a right checksum, and the rest; bytes that begin none are dropped."""
    requests = []
    while len(received) >= REQUEST_BYTES:
        head = received[:REQUEST_BYTES]
        if crc(head[:-2]) == head[-2:]:
            requests.append(head)
            received = received[REQUEST_BYTES:]
        else:
            received = received[1:]
    return requests, received


def answer(device: int, function: int, registers: bytes) -> bytes:
    """The answer with registers."""
    body = bytes((device, function, len(registers))) + registers
    return body + crc(body)


def refusal(device: int, function: int, code: int = ILLEGAL_ADDRESS) -> bytes:
    """The answer where a register is not there, or where something else prevents one."""
    body = bytes((device, function | 0x80, code))
    return body + crc(body)


class Modbus(Instrument):
    """Answers requests of one number, not damaged ones; ``settings`` are those of any of its gauges."""

    baudrate: ClassVar[int] = 19200
    bits_a_byte: ClassVar[int] = 11
    has_channels: ClassVar[bool] = True
    command_end: ClassVar[bytes] = b""

    def __init__(self, indicators: Mapping[int, Indicator], settings: ModbusSettings) -> None:
        super().__init__(indicators)
        self._settings = settings

    def split(self, received: bytes) -> tuple[list[bytes], bytes]:
        return split_requests(received)

    def answer(self, command: bytes) -> bytes:
        device, function, register, _count = struct.unpack(">BBHH", command[:-2])
        place = device << 16 | register
        if device not in {known >> 16 for known in self.indicators}:
            return b""
        if place not in self.indicators:
            return refusal(device, function)
        if not self.indicators[place].powered:
            return b""
        return answer(device, function, self._value(place))

    def _value(self, channel: int) -> bytes:
        shown, settings = self.indicators[channel].shown(), self._settings
        if shown is None:
            number: float = settings.at_end[0] if settings.at_end else 0
        else:
            number = shown * (MM_PER_INCH if self.indicators[channel].inch else 1.0) / settings.mm_per_unit
        is_float = settings.type == "float32"
        data = struct.pack(FORMATS[settings.type], number if is_float else round(number))
        return data[2:] + data[:2] if settings.word_order == "little" else data
