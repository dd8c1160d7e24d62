"""A scripted serial port that expects these requests in this order and gives these answers."""

from typing import Any

import pytest
import serial

from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from tests.drivers.serial.port_time import SLICE_S, PortTime

TIMEOUT_S = 0.05
WORST_LATENCY_S = 0.05


class Dialogue:
    """A scripted serial port."""

    def __init__(self):
        self.time = PortTime()
        self.is_open = False
        self.expected = []
        self.pending = b""
        self.broken = None
        self.settings = {}
        self.dtr = self.rts = True

    def expect(self, *pairs):
        """Add questions with their answers, several bytes strings a question if need be."""
        self.expected += [(question, b"".join(answers)) for question, *answers in pairs]

    def unasked(self, data):
        """Put unsolicited bytes on the line."""
        self.pending += data

    def open(self):
        self.is_open, self.pending = True, b""

    def close(self):
        self.is_open = False

    @property
    def in_waiting(self):
        if self.broken is not None:
            raise self.broken
        return len(self.pending)

    def read(self, size):
        if not self.in_waiting:
            self.time.wait_for_bytes()
        data, self.pending = self.pending[:size], self.pending[size:]
        return data

    def write(self, question):
        assert self.expected, f"asked {question!r}, and nothing more was to be asked"
        expected, answer = self.expected.pop(0)
        assert question == expected
        self.pending += answer


@pytest.fixture
def dialogue(monkeypatch):
    """The scripted port behind every URL; all of it must have been said at the end of the test."""
    port = Dialogue()

    def serial_for_url(url, *, do_not_open, **settings):
        assert do_not_open
        port.settings = settings
        return port

    port.time.install(monkeypatch)
    monkeypatch.setattr(serial, "serial_for_url", serial_for_url)
    yield port
    assert port.expected == []


@pytest.fixture
async def links():
    links = SharedSerialPorts(worst_latency_s=WORST_LATENCY_S)
    yield links
    await links.close()


@pytest.fixture
def settings():
    """Settings of a gauge, by its protocol."""

    def make(protocol, name="y", **changes):
        given = {"axis": "y", "port": "wire", "timeout_s": TIMEOUT_S, "settle_s": 0.0, **changes}
        return GaugeSettings(name=name, protocol=protocol, **given)

    return make


GAP_S = 2 * SLICE_S


class StreamingLine:
    """What a scripted port sends while somebody waits for bytes."""

    def __init__(self, dialogue: Any) -> None:
        self._dialogue = dialogue
        self._planned: list[tuple[float, bytes]] = []
        self._repeated, self._next_s = b"", 0.0
        wait = dialogue.time.wait_for_bytes

        def wait_and_send() -> None:
            wait()
            self._send_due()

        dialogue.time.wait_for_bytes = wait_and_send

    def repeats(self, data: bytes, first: bytes = b"", first_at_s: float = 0.0) -> None:
        """From now on send ``data`` again and again, ``first`` once before."""
        now = self._dialogue.time.now_s
        self._repeated, self._next_s = data, now + first_at_s + GAP_S
        if first:
            self._planned.append((now + first_at_s, first))

    def stops(self) -> None:
        """Send no more."""
        self._repeated = b""

    def at_s(self, after_s: float, data: bytes) -> None:
        """Send ``data`` so long after now, and nothing else."""
        self.stops()
        self._planned.append((self._dialogue.time.now_s + after_s, data))

    def backlog(self, data: bytes) -> None:
        """What came while nobody read."""
        self._dialogue.unasked(data)

    def _send_due(self) -> None:
        now = self._dialogue.time.now_s
        while self._planned and self._planned[0][0] <= now:
            self._dialogue.pending += self._planned.pop(0)[1]
        if self._repeated and now >= self._next_s:
            self._next_s = now + GAP_S
            self._dialogue.pending += self._repeated


@pytest.fixture
def line(dialogue):
    return StreamingLine(dialogue)
