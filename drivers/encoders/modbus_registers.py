"""Which registers hold the positions of the legs, in as few requests as may be, and the counts in them."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.cell.described_devices import ModbusEncoderSettings

MAX_REGISTERS = 125
"""Of an answer (Modbus Application Protocol 6.3)."""

REGISTER_BITS, REGISTER_BYTES = 16, 2


@dataclass(frozen=True, slots=True)
class RegisterSpan:
    """Registers of one device that one request asks for, and the legs that are in them, from 1."""

    device: int
    first: int
    count: int
    legs: tuple[int, ...]

    @property
    def subject(self) -> str:
        """Of messages."""
        legs = ", ".join(map(str, sorted(self.legs)))
        named = f"encoder of leg {legs}" if len(self.legs) == 1 else f"encoders of legs {legs}"
        return f"{named} (device {self.device})"


def register_spans(described: ModbusEncoderSettings, *, joined: bool) -> tuple[RegisterSpan, ...]:
    """The requests for all legs; ``joined``: one for the legs of a device, as far as an answer reaches."""
    words = described.bits // REGISTER_BITS
    spans: list[RegisterSpan] = []
    for (device, register), leg in sorted((place, leg) for leg, place in enumerate(described.places, 1)):
        last = spans[-1] if spans else None
        count = register + words - last.first if last else 0
        if joined and last and last.device == device and count <= MAX_REGISTERS:
            spans[-1] = RegisterSpan(device, last.first, count, (*last.legs, leg))
        else:
            spans.append(RegisterSpan(device, register, words, (leg,)))
    return tuple(spans)


def counts_in(
    data: bytes, span: RegisterSpan, described: ModbusEncoderSettings, *, signed: bool
) -> dict[int, int]:
    """The counts by leg in the registers of a span, each with its high byte first."""
    size = described.bits // 8
    starts = {leg: REGISTER_BYTES * (described.registers[leg - 1] - span.first) for leg in span.legs}
    return {
        leg: _count(data[start : start + size], described, signed=signed) for leg, start in starts.items()
    }


def _count(data: bytes, described: ModbusEncoderSettings, *, signed: bool) -> int:
    registers = [data[start : start + REGISTER_BYTES] for start in range(0, len(data), REGISTER_BYTES)]
    if described.word_order == "little":
        registers.reverse()
    return int.from_bytes(b"".join(registers), signed=signed)
