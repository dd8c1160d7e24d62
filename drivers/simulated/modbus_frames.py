"""Frames of Modbus RTU as a device has them: requests in, answers out, each with its checksum."""

from __future__ import annotations

import struct

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
