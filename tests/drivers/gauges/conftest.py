"""A scripted serial port that expects these requests in this order and gives these answers."""

import pytest
import serial

from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from tests.drivers.serial.port_time import PortTime

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
        given = {"axis": "y", "port": "wire", "timeout_s": TIMEOUT_S, **changes}
        return GaugeSettings(name=name, protocol=protocol, **given)

    return make
