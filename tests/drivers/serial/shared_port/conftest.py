"""Links whose URLs lead to a fake port."""

import math
import threading

import pytest
import serial

from drivers.serial.shared_port import SharedSerialPort, SharedSerialPorts
from tests.drivers.serial.port_time import PortTime
from tests.waiting import until

WORST_LATENCY_S = 0.3
SOON_S = 0.05
LONG_S = 30.0
FOREVER_S = math.inf


class FakePort:
    """Delivers what ``answer`` says for each question, each part after its delay."""

    def __init__(self, answer=lambda request: [(0.0, b"+1.234\r")]):
        self.time = PortTime()
        self.is_open = False
        self.asked = []
        self.asked_at_s = []
        self.due = []
        self.broken = None
        self.threads = set()
        self.written = threading.Event()
        self._answer = answer

    def open(self):
        self.is_open = True

    def close(self):
        self.is_open = False

    @property
    def in_waiting(self):
        self._fail()
        return sum(len(data) for due, data in self.due if due <= self.time.now_s)

    def read(self, size):
        self._fail()
        if not self.in_waiting:
            self.time.wait_for_bytes()
        here = b"".join(data for due, data in self.due if due <= self.time.now_s)
        later = [(due, data) for due, data in self.due if due > self.time.now_s]
        self.due = [(0.0, here[size:])] * bool(here[size:]) + later
        return here[:size]

    def write(self, request):
        self._fail()
        self.threads.add(threading.current_thread().name)
        self.asked.append(request)
        self.asked_at_s.append(self.time.now_s)
        self.written.set()
        self.due += [(self.time.now_s + delay, data) for delay, data in self._answer(request)]

    def _fail(self):
        if self.broken is not None:
            raise self.broken


LINKS: list[SharedSerialPort] = []
"""What was opened and is closed with the test."""


def link_to(url="fake", settings=None, **options):
    LINKS.append(SharedSerialPort(url, settings or {}, **options))
    return LINKS[-1]


async def opened(url="fake", **settings):
    link = link_to(url, settings, worst_latency_s=WORST_LATENCY_S)
    await link.open()
    return link


async def written(port):
    await until(port.written.is_set)


@pytest.fixture
def fake(monkeypatch):
    """Make every URL lead to a given fake port, in its time, and note how it was asked for."""

    def install(port):
        def serial_for_url(url, *, do_not_open, **settings):
            assert do_not_open
            port.url, port.settings = url, settings
            return port

        port.time.install(monkeypatch)
        monkeypatch.setattr(serial, "serial_for_url", serial_for_url)
        return port

    return install


@pytest.fixture(autouse=True)
async def closed_links():
    yield
    while LINKS:
        await LINKS.pop().close()


@pytest.fixture
async def links():
    links = SharedSerialPorts(worst_latency_s=WORST_LATENCY_S)
    yield links
    await links.close()
