"""Serial lines inside this process, in simulated time, in the place of pyserial's ports.

An answer comes byte by byte, after a latency and at a baud rate; a line may damage bytes. A line with a
parity has a terminal behind it that checks it, as the kernel does with INPCK and PARMRK.
"""

from __future__ import annotations

import errno
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

import pytest
import serial

from drivers.serial import port
from drivers.simulated.gauges.instruments import Instrument
from drivers.simulated.gauges.server import LineFaults

MARK = b"\xff\0"
"""What a terminal puts before a byte of wrong parity."""

LATE_S = 0.75
"""A late answer comes so long after the others: later than a driver waits by default."""

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

    ``with_processor_time``: it also passes while the thread works, which it may do between two bytes.
    ``elsewhere_s`` gives how long all lines were left alone.
    """

    def __init__(
        self, *, with_processor_time: bool = False, elsewhere_s: Callable[[], float] = float
    ) -> None:
        self.waited_s = 0.0
        self._elsewhere_s = elsewhere_s
        self._works = time.thread_time if with_processor_time else lambda: 0.0

    def monotonic(self) -> float:
        return self.waited_s + self._works() + self._elsewhere_s()

    time = monotonic

    def wait_until(self, due_s: float) -> None:
        self.waited_s += max(0.0, due_s - self.monotonic())


class InstrumentLine:
    """What the driver takes for a port of pyserial.

    Attributes:
        elapsed_s: simulated seconds up to the latest byte.
        asked: how many requests came.
        faults: of the line, by name.
        unplugged: whether it is.
        silent: whether all answers are lost.
    """

    def __init__(
        self, instrument: Instrument, damage: Damage, *, latency_s: float = 0.0, byte_s: float = 0.0
    ) -> None:
        self.is_open = False
        self.dtr = self.rts = True
        self.timeout = self.write_timeout = 0.0
        self.elapsed_s = 0.0
        self.asked = 0
        self.faults = LineFaults(LATE_S)
        self.unplugged = self.silent = False
        self.instrument = instrument
        self._damage = damage
        self._latency_s = latency_s
        self._byte_s = byte_s
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
        self.elapsed_s = time.monotonic()
        data = bytearray()
        while len(data) < size and coming and coming[0][0] <= self.elapsed_s:
            data.append(coming.popleft()[1])
        return bytes(data)

    def write(self, request: bytes) -> None:
        self._require_plugged()
        self.asked += 1
        command = request.rstrip(b"\r\n")
        late_s = self.faults.delay_s()
        answer = self.faults.sent(command, self.instrument.answer(command))
        due_s = self._time.monotonic() + len(request) * self._byte_s + self._latency_s + late_s
        for character in self._damage.of(self._with_parity(b"" if self.silent else answer)):
            due_s += self._byte_s
            self._coming += [(due_s, byte) for byte in self._received(character)]

    def introduce(self) -> None:
        """Have the instrument say what it says when it is switched on."""
        self._coming += [(0.0, byte) for byte in self.instrument.introduction]

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


def have_lines(
    monkeypatch: pytest.MonkeyPatch, lines: dict[str, InstrumentLine], line_time: LineTime | None = None
) -> None:
    """Let pyserial open these lines by their URL."""
    line_time = line_time or LineTime()

    def opened(url: str, *, do_not_open: bool, parity: str = "N", **_: object) -> InstrumentLine:
        assert do_not_open
        return lines[url].opened_with(line_time, parity)

    monkeypatch.setattr(port, "time", line_time)
    monkeypatch.setattr(serial, "serial_for_url", opened)
