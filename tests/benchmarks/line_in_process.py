"""Gauges on serial lines inside this process, in simulated time, in the place of pyserial's ports.

A line may damage bytes. One with a parity has a terminal behind it that checks it, as the kernel does with
INPCK and PARMRK.
"""

from __future__ import annotations

import errno
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from random import Random

import pytest
import serial

from drivers.serial import port, request_port
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import instrument_class
from drivers.simulated.gauges.instruments import Indicator, Instrument
from drivers.simulated.gauges.server import LineFaults
from drivers.wire_trace import WireTrace
from hexacell.cell.devices import GaugeSettings
from hexacell.plugins import Group, load
from procedures.devices.device_set import MountedGauge

MARK = b"\xff\0"
"""What a terminal puts before a byte of wrong parity."""

LATE_S = 0.75
"""A late answer comes so long after the others: later than a driver waits by default."""

TRACE_BYTES = 50_000
"""Of each line: so little that it is full soon, and grows no more."""

ODD_BITS = {"E": 0, "O": 1}
ONE_BIT, BURST, LOST = 0.7, 0.85, 0.95
"""Up to these shares a damaged byte has one other bit, is any other one, is lost; the rest comes twice."""


@dataclass
class Damage:
    """How many bytes of answers are damaged, and what came of it.

    Attributes:
        share: of the bytes.
        answers: how many were sent.
        damaged: how many of them differ from what was sent.
    """

    share: float = 0.0
    random: Random = field(default_factory=Random)
    answers: int = 0
    damaged: int = 0

    def of(self, answer: bytes) -> bytes:
        """The characters that come of an answer, eight bits each."""
        self.answers += 1
        if not self.share:
            return answer
        came = bytearray()
        for character in answer:
            came += self._one(character) if self.random.random() < self.share else bytes((character,))
        self.damaged += came != answer
        return bytes(came)

    def _one(self, character: int) -> bytes:
        kind = self.random.random()
        if kind < ONE_BIT:
            return bytes((character ^ 1 << self.random.randrange(8),))
        if kind < BURST:
            return bytes((self.random.randrange(256),))
        return b"" if kind < LOST else bytes((character, character))


class LineTime(threading.local):
    """The time of each line, which has a thread of its own: it passes while the line waits for bytes.

    ``elsewhere_s`` gives how long all lines were left alone.
    """

    def __init__(self, elsewhere_s: Callable[[], float] = float) -> None:
        self.waited_s = 0.0
        self._elsewhere_s = elsewhere_s

    def monotonic(self) -> float:
        return self.waited_s + self._elsewhere_s()

    time = monotonic

    def wait_until(self, due_s: float) -> None:
        self.waited_s += max(0.0, due_s - self.monotonic())


class InstrumentLine:
    """What the driver takes for a port of pyserial.

    Attributes:
        faults: of the line, by name.
        unplugged: whether it is.
        silent: whether all answers are lost.
    """

    def __init__(self, instrument: Instrument, damage: Damage) -> None:
        self.is_open = False
        self.dtr = self.rts = True
        self.timeout = self.write_timeout = 0.0
        self.faults = LineFaults(LATE_S)
        self.unplugged = self.silent = False
        self._instrument = instrument
        self._damage = damage
        self._time = LineTime()
        self._odd: int | None = None
        self._coming: deque[tuple[float, int]] = deque()

    def opened_with(self, time: LineTime, parity: str) -> InstrumentLine:
        """Pass this line on as the port with these settings."""
        self._time, self._odd = time, ODD_BITS.get(parity)
        return self

    def open(self) -> None:
        self._require_plugged()
        self.is_open = True
        self._coming.clear()

    def close(self) -> None:
        self.is_open = False

    @property
    def in_waiting(self) -> int:
        self._require_plugged()
        now_s = self._time.monotonic()
        return sum(due_s <= now_s for due_s, _ in self._coming)

    def read(self, size: int) -> bytes:
        self._require_plugged()
        time, coming = self._time, self._coming
        until_s = time.monotonic() + self.timeout
        time.wait_until(min(until_s, coming[0][0]) if coming else until_s)
        now_s, data = time.monotonic(), bytearray()
        while len(data) < size and coming and coming[0][0] <= now_s:
            data.append(coming.popleft()[1])
        return bytes(data)

    def write(self, request: bytes) -> None:
        self._require_plugged()
        command = request.rstrip(b"\r\n")
        due_s = self._time.monotonic() + self.faults.delay_s()
        answer = self.faults.sent(command + self._instrument.command_end, self._instrument.answer(command))
        for character in self._damage.of(self._with_parity(b"" if self.silent else answer)):
            self._coming += [(due_s, byte) for byte in self._received(character)]

    def introduce(self) -> None:
        """Have the instrument say what it says when it is switched on."""
        self._coming += [(0.0, byte) for byte in self._instrument.introduction]

    def _require_plugged(self) -> None:
        if self.unplugged:
            raise serial.SerialException(errno.ENOENT, "unplugged")

    def _with_parity(self, answer: bytes) -> bytes:
        if self._odd is None:
            return answer
        return bytes(byte | self._parity(byte) << 7 for byte in answer)

    def _received(self, character: int) -> bytes:
        if self._odd is None:
            return bytes((character,))
        byte = character & 0x7F
        return (b"" if character >> 7 == self._parity(byte) else MARK) + bytes((byte,))

    def _parity(self, byte: int) -> int:
        return (byte.bit_count() + (self._odd or 0)) % 2


class GaugesOnLines:
    """Gauges whose ports pyserial opens here; those with one port are channels of one instrument.

    Attributes:
        indicators: what shows the plungers, in the order of the settings.
        lines: by their ports.
    """

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        settings: Sequence[GaugeSettings],
        plungers_mm: list[float],
        damage: Damage,
        time: LineTime,
    ) -> None:
        self.indicators = [
            Indicator(partial(plungers_mm.__getitem__, place), one.travel_mm)
            for place, one in enumerate(settings)
        ]
        on_port: dict[str, dict[int, Indicator]] = {}
        for one, indicator in zip(settings, self.indicators, strict=True):
            on_port.setdefault(str(one.port), {})[one.channel] = indicator
        self.lines = {}
        for one in settings:
            described = () if one.described is None else (one.described,)
            instrument = instrument_class(one.protocol)(on_port[str(one.port)], *described)
            self.lines[str(one.port)] = InstrumentLine(instrument, damage)

        def opened(url: str, *, do_not_open: bool, parity: str = "N", **_: object) -> InstrumentLine:
            assert do_not_open
            return self.lines[url].opened_with(time, parity)

        for module in (port, request_port):
            monkeypatch.setattr(module, "time", time)
        monkeypatch.setattr(serial, "serial_for_url", opened)
        self._ports = SharedSerialPorts(trace=WireTrace(TRACE_BYTES))
        self.mounted = tuple(
            MountedGauge(load(Group.GAUGES, one.protocol)(one, self._ports), one.mounting)
            for one in settings
        )

    async def open(self) -> None:
        """All of them, again."""
        for mounted in self.mounted:
            await mounted.gauge.close()
            await mounted.gauge.open()

    async def close(self) -> None:
        for mounted in self.mounted:
            await mounted.gauge.close()
        await self._ports.close()
