"""Serial settings, and gauges that share one port."""

import pytest

from hexacell.errors import ExitCode, FileError
from tests.drivers.serial.shared_port.fake_port import FakePort, opened


async def test_settings_reach_pyserial_unchanged(fake):
    port = fake(FakePort())
    await opened("any://url?x=1", baudrate=4800, parity="E", xonxoff=True, timeout=99, rts=False)
    assert port.url == "any://url?x=1"
    assert port.settings == {"baudrate": 4800, "parity": "E", "xonxoff": True, "timeout": 99}
    assert port.rts is False
    assert port.timeout <= 0.2
    assert port.write_timeout <= 0.2


@pytest.mark.parametrize(
    ("url", "settings"),
    [
        ("nonsense://x", {}),
        ("loop://", {"colour": "red"}),
        ("loop://", {"baudrate": "fast"}),
        ("loop://", {"parity": "X"}),
        ("loop://", {"url": "loop://"}),
        ("loop://", {"do_not_open": False}),
    ],
)
async def test_settings_that_pyserial_refuses_are_errors_of_the_cell_file(links, url, settings):
    with pytest.raises(FileError, match="are refused") as caught:
        await links.acquire(url, "x", settings).open()
    assert caught.value.exit_code is ExitCode.USAGE


async def test_gauges_on_one_port_share_it_until_the_last_releases_it(links, fake):
    port = fake(FakePort())
    x = links.acquire("fake", "x", {"baudrate": 9600}, channel=1)
    y = links.acquire("fake", "y", {"baudrate": 9600}, channel=2)
    assert x is y
    assert x.line.subject == "gauges x, y"
    await x.open()
    await links.release("fake", "x")
    await links.release("fake", "x")
    assert port.is_open
    assert x.line.subject == "gauge y"
    await links.release("fake", "y")
    assert not port.is_open
    z = links.acquire("fake", "z", {"baudrate": 300})
    assert z is not x


@pytest.mark.parametrize(
    ("settings", "channel", "words"),
    [
        ({"baudrate": 300}, 2, "shared with gauge x under other serial settings"),
        ({"baudrate": 9600}, 1, "channel 1, already belongs to gauge x"),
        ({"baudrate": 9600}, None, "already belongs to gauge x"),
    ],
)
async def test_conflicting_settings_and_channels_of_a_shared_port_are_refused(
    links, settings, channel, words
):
    first = links.acquire("loop://", "x", {"baudrate": 9600}, channel=1)
    with pytest.raises(FileError, match=words) as caught:
        links.acquire("loop://", "y", settings, channel=channel)
    assert caught.value.subject == "gauge y"
    assert first.line.subject == "gauge x"


async def test_closing_all_closes_ports_still_in_use(links, fake):
    port = fake(FakePort())
    await links.acquire("fake", "x", {}).open()
    await links.close()
    assert not port.is_open
    await links.release("fake", "x")
