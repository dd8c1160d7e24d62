"""Simulated Modbus RTU devices on one line, each register with an indicator."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import ClassVar

from drivers.simulated.gauges.instruments import MM_PER_INCH, Indicator, Instrument
from hexacell.cell.described_devices import ModbusSettings

PACKED = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}
REQUEST_BYTES = 8
ILLEGAL_ADDRESS = 2
POLYNOMIAL = 0xA001
READ_FUNCTIONS = (3, 4)
WRITE_REGISTER = 6
BROADCAST = 0


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


def refusal(device: int, function: int) -> bytes:
    """The answer where a register is not there."""
    body = bytes((device, function | 0x80, ILLEGAL_ADDRESS))
    return body + crc(body)


class Modbus(Instrument):
    """Answers requests of one number, not damaged ones; ``settings`` are those of any of its gauges."""

    baudrate: ClassVar[int] = 19200
    bits_a_byte: ClassVar[int] = 11
    has_channels: ClassVar[bool] = True

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
        data = struct.pack(PACKED[settings.type], number if is_float else round(number))
        return data[2:] + data[:2] if settings.word_order == "little" else data
