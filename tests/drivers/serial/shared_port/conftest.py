"""Links whose URLs lead to a fake port."""

import pytest
import serial

from drivers.serial.shared_port import SharedSerialPorts
from tests.drivers.serial.shared_port.fake_port import LINKS, WORST_LATENCY_S


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
