"""Simulated encoders with Modbus RTU: counts in the registers of one device or of several, on one line."""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import ClassVar

from drivers.simulated.gauges.instruments import Instrument
from drivers.simulated.gauges.modbus import BROADCAST, WRITE_REGISTER, answer, refusal, split_requests
from drivers.simulated.gauges.server import LATE_TIMEOUTS, GaugeLineServer, LineFault, LineFaults
from drivers.simulated.serial_line import PtyLine, SerialLine
from drivers.simulated.served_device import Closeable, Switch
from hexacell.cell.described_devices import ModbusEncoderSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.clock import CellClock

JUMP = 400.0
Positions = Callable[[], Sequence[float]]
Counts = Callable[[], Sequence[int]]


class ModbusScales(Instrument):
    """The devices of six encoders: answers requests for any registers from the first to the last position.

    ``counts`` gives those of legs 1 to 6. ``has_gaps``: registers between positions are there too.
    """

    baudrate: ClassVar[int] = 19200
    bits_a_byte: ClassVar[int] = 11

    def __init__(self, described: ModbusEncoderSettings, counts: Counts, *, has_gaps: bool = True) -> None:
        super().__init__({})
        self._described, self._counts, self._has_gaps = described, counts, has_gaps
        self._latched: Sequence[int] | None = None
        self.silent_legs: frozenset[int] = frozenset()

    def split(self, received: bytes) -> tuple[list[bytes], bytes]:
        return split_requests(received)

    def answer(self, command: bytes) -> bytes:
        """The registers, or an exception; nothing to all at once, or if no device has that address."""
        device, function, register, number = struct.unpack(">BBHH", command[:-2])
        latch = self._described.latch
        if device == BROADCAST:
            if latch is not None and (function, register, number) == (
                WRITE_REGISTER,
                latch.register_,
                latch.value,
            ):
                self._latched = tuple(self._counts())
            return b""
        if device not in self._described.devices or self._is_silent(device):
            return b""
        held = self._registers(device)
        wanted = [held.get(register + place) for place in range(number)]
        if None in wanted:
            return refusal(device, function)
        return answer(device, function, struct.pack(f">{number}H", *wanted))

    def _is_silent(self, device: int) -> bool:
        return any(self._described.devices[leg - 1] == device for leg in self.silent_legs)

    def _registers(self, device: int) -> dict[int, int]:
        """What a device holds, by register."""
        described, counts = self._described, self._counts() if self._latched is None else self._latched
        words = described.bits // 16
        own = [leg for leg, place in enumerate(described.places) if place[0] == device]
        held: dict[int, int] = {}
        if self._has_gaps:
            first = min(described.registers[leg] for leg in own)
            held = dict.fromkeys(range(first, max(described.registers[leg] for leg in own)), 0)
        for leg in own:
            data = (counts[leg] % (1 << described.bits)).to_bytes(2 * words)
            numbers = struct.unpack(f">{words}H", data)
            ordered = numbers if described.word_order == "big" else numbers[::-1]
            held |= {described.registers[leg] + place: number for place, number in enumerate(ordered)}
        return held


class SimulatedModbusBank(Closeable):
    """Six encoders on a serial line; serves until it is closed.

    ``positions`` gives the six joint variables, when they are asked for. Answers come ``latency_s`` of the
    cell's time after requests, beside what the line takes.
    """

    def __init__(
        self,
        settings: EncoderSettings,
        described: ModbusEncoderSettings,
        positions: Positions,
        clock: CellClock,
        latency_s: float = 0.0,
        *,
        line: SerialLine | None = None,
        has_gaps: bool = True,
    ) -> None:
        self._settings, self._positions = settings, positions
        self._lock = threading.Lock()
        self._shifts = [0.0] * 6
        self._reversed: set[int] = set()
        self._frozen: dict[int, int] = {}
        self._invalid: set[int] = set()
        self._scales = ModbusScales(described, self._counts, has_gaps=has_gaps)
        self._served = GaugeLineServer(
            self._scales,
            line or PtyLine("encoders"),
            clock,
            latency_s=latency_s,
            faults=LineFaults(LATE_TIMEOUTS * settings.timeout_s),
        )
        self._described = described
        self.described = described.model_copy(update={"port": self._served.url})
        """Where a driver finds them."""

    def faults(self, leg: int) -> dict[FaultKind, Switch]:
        found: dict[FaultKind, Switch] = {
            "unplugged": self._served.set_unplugged,
            "silent": partial(self._set_silent, leg),
            "reversed": partial(self._set_reversed, leg),
            "zeroed": partial(self._set_zeroed, leg),
            "frozen": partial(self._set_frozen, leg),
            "jumped": partial(self._set_jumped, leg),
            **{fault.value: partial(self._served.faults.switch, fault) for fault in LineFault},
        }
        return found | ({"alarm": partial(self._set_invalid, leg)} if self._described.invalid else {})

    def close(self) -> None:
        self._served.close()

    def _counts(self) -> list[int]:
        with self._lock:
            return [self._count(leg, position) for leg, position in enumerate(self._positions(), 1)]

    def _count(self, leg: int, position: float) -> int:
        if leg in self._invalid:
            return self._described.invalid[0]
        return self._frozen.get(leg, self._true_count(leg, position))

    def _true_count(self, leg: int, position: float) -> int:
        settings = self._settings
        sign = -1 if leg in self._reversed else 1
        shown = (position - settings.offset[leg - 1]) * settings.direction[leg - 1]
        return round(sign * (shown + self._shifts[leg - 1]) / settings.step)

    def _set_silent(self, leg: int, *, on: bool) -> None:
        """The device of the leg answers nothing, or again."""
        self._scales.silent_legs = (
            self._scales.silent_legs | {leg} if on else self._scales.silent_legs - {leg}
        )

    def _set_reversed(self, leg: int, *, on: bool) -> None:
        with self._lock:
            (self._reversed.add if on else self._reversed.discard)(leg)

    def _set_zeroed(self, leg: int, *, on: bool) -> None:
        with self._lock:
            settings = self._settings
            now = (self._positions()[leg - 1] - settings.offset[leg - 1]) * settings.direction[leg - 1]
            self._shifts[leg - 1] = -now if on else 0.0

    def _set_jumped(self, leg: int, *, on: bool) -> None:
        with self._lock:
            self._shifts[leg - 1] = JUMP if on else 0.0

    def _set_frozen(self, leg: int, *, on: bool) -> None:
        with self._lock:
            if on:
                self._frozen[leg] = self._true_count(leg, self._positions()[leg - 1])
            else:
                self._frozen.pop(leg, None)

    def _set_invalid(self, leg: int, *, on: bool) -> None:
        with self._lock:
            (self._invalid.add if on else self._invalid.discard)(leg)
