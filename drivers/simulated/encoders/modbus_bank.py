"""Simulated encoders with Modbus RTU: counts in the registers of one device or of several, on one line."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from drivers.serial.modbus_port import BROADCAST
from drivers.simulated.encoders.bank import JUMP, Positions, shown_positions
from drivers.simulated.gauges.described import WRITE_REGISTER, answer, refusal, split_requests
from drivers.simulated.gauges.instruments import Instrument
from drivers.simulated.gauges.server import LATE_TIMEOUTS, GaugeLineServer, LineFault, LineFaults
from drivers.simulated.serial_line import PtyLine
from drivers.simulated.served_device import Closeable, Switch, setting
from hexacell.cell.described_devices import ModbusEncoderSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.cell.simulation import FaultKind
from hexacell.clock import CellClock

Counts = Callable[[], Sequence[int]]


@dataclass
class _Scale:
    """What is wrong with one encoder; ``frozen`` is the count at which it stands."""

    is_silent: bool = False
    is_reversed: bool = False
    is_invalid: bool = False
    shift: float = 0.0
    frozen: int | None = None


class ModbusScales(Instrument):
    """The devices of six encoders: answers requests for any registers from the first to the last position.

    ``counts`` gives those of legs 1 to 6, ``scales`` what is wrong with them.
    """

    baudrate: ClassVar[int] = 19200
    bits_a_byte: ClassVar[int] = 11
    command_end: ClassVar[bytes] = b""

    def __init__(self, described: ModbusEncoderSettings, counts: Counts) -> None:
        super().__init__({})
        self._described, self._counts = described, counts
        self._latched: Sequence[int] | None = None
        self.scales = tuple(_Scale() for _ in described.registers)

    def split(self, received: bytes) -> tuple[list[bytes], bytes]:
        return split_requests(received)

    def answer(self, command: bytes) -> bytes:
        """The registers, or an exception; nothing to all at once, or if no device has that address."""
        device, function, register, number = struct.unpack(">BBHH", command[:-2])
        latch, devices = self._described.latch, self._described.devices
        if device == BROADCAST:
            if latch and (function, register, number) == (WRITE_REGISTER, latch.register_, latch.value):
                self._latched = tuple(self._counts())
            return b""
        silent = [own for own, scale in zip(devices, self.scales, strict=True) if scale.is_silent]
        if device not in devices or device in silent:
            return b""
        held = self._registers(device)
        wanted = [held.get(register + place) for place in range(number)]
        if None in wanted:
            return refusal(device, function)
        return answer(device, function, struct.pack(f">{number}H", *wanted))

    def _registers(self, device: int) -> dict[int, int]:
        """What a device holds, by register."""
        described, counts = self._described, self._counts() if self._latched is None else self._latched
        words = described.bits // 16
        own = [leg for leg, place in enumerate(described.places) if place[0] == device]
        registers = [described.registers[leg] for leg in own]
        held = dict.fromkeys(range(min(registers), max(registers)), 0)
        for leg in own:
            data = (counts[leg] % (1 << described.bits)).to_bytes(2 * words)
            numbers = struct.unpack(f">{words}H", data)
            ordered = numbers if described.word_order == "big" else numbers[::-1]
            held |= {described.registers[leg] + place: number for place, number in enumerate(ordered)}
        return held


class SimulatedModbusBank(Closeable):
    """Six encoders on a serial line; serves until it is closed.

    ``positions`` gives the six joint variables, when they are asked for. Answers come ``latency_s`` of the
    cell's time after requests, beside what the line takes. ``described`` is where a driver finds them.
    """

    def __init__(
        self,
        settings: EncoderSettings,
        described: ModbusEncoderSettings,
        positions: Positions,
        clock: CellClock,
        latency_s: float = 0.0,
    ) -> None:
        self._settings, self._positions = settings, positions
        scales = ModbusScales(described, self._counts)
        self._faulty = scales.scales
        self._served = GaugeLineServer(
            scales,
            PtyLine("encoders"),
            clock,
            latency_s=latency_s,
            faults=LineFaults(LATE_TIMEOUTS * settings.timeout_s),
        )
        self.described = described.model_copy(update={"port": self._served.url})
        self.address: dict[str, Any] = {"modbus": self.described}

    def faults(self, leg: int) -> dict[FaultKind, Switch]:
        scale = self._faulty[leg - 1]
        found: dict[FaultKind, Switch] = {
            "unplugged": self._served.set_unplugged,
            "silent": setting(scale, "is_silent"),
            "reversed": setting(scale, "is_reversed"),
            "zeroed": partial(self._set_zeroed, leg),
            "frozen": partial(self._set_frozen, leg),
            "jumped": setting(scale, "shift", JUMP, 0.0),
            **{fault.value: partial(self._served.faults.switch, fault) for fault in LineFault},
        }
        return found | ({"alarm": setting(scale, "is_invalid")} if self.described.invalid else {})

    def close(self) -> None:
        self._served.close()

    def _counts(self) -> list[int]:
        counts = []
        for scale, shown in zip(self._faulty, self._shown(), strict=True):
            sign = -1 if scale.is_reversed else 1
            count = round(sign * (shown + scale.shift) / self._settings.step)
            held = count if scale.frozen is None else scale.frozen
            counts.append(self.described.invalid[0] if scale.is_invalid else held)
        return counts

    def _shown(self) -> list[float]:
        return shown_positions(self._settings, self._positions)

    def _set_zeroed(self, leg: int, *, on: bool) -> None:
        self._faulty[leg - 1].shift = -self._shown()[leg - 1] if on else 0.0

    def _set_frozen(self, leg: int, *, on: bool) -> None:
        self._faulty[leg - 1].frozen = self._counts()[leg - 1] if on else None
