"""Serial settings, gauges that share one port, and ports that fail and are opened again."""

import errno
import os
import termios
import threading
from unittest.mock import Mock

import pytest
import serial

from drivers.encoders.can_bus import EncoderBus
from drivers.errors import BusError
from drivers.stop_input import CombinedStopInput
from hexacell.errors import DeviceError, ExitCode, FileError
from tests.drivers.serial.shared_port.conftest import LONG_S, FakePort, link_to, opened


async def test_settings_reach_pyserial_unchanged(fake):
    port = fake(FakePort())
    await opened("socket://url:1?x=1", baudrate=4800, parity="E", xonxoff=True, timeout=99, rts=False)
    assert port.url == "socket://url:1?x=1"
    assert port.settings == {"baudrate": 4800, "parity": "E", "xonxoff": True, "timeout": 99}
    assert port.rts is False
    assert port.timeout <= 0.2
    assert port.write_timeout <= 0.2
    del port.write_timeout
    await opened("rfc2217://host:4001")
    assert not hasattr(port, "write_timeout"), "pyserial refuses to open such a port with one"


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


@pytest.mark.parametrize("scheme", ["spy", "SPY", "alt", "hwgrep", "cp2110", "unknown"])
async def test_a_url_by_which_pyserial_does_more_than_open_a_port_is_refused(links, tmp_path, scheme):
    (tmp_path / "cell.toml").write_text("kept")
    url = f"{scheme}:///dev/null?file={tmp_path / 'cell.toml'}"
    with pytest.raises(FileError, match="are refused"):
        await links.acquire(url, "x", {}).open()
    with pytest.raises(FileError, match="are refused"):
        await CombinedStopInput(url=url).open()
    with pytest.raises(BusError, match="are refused"):
        EncoderBus({"interface": "slcan", "channel": url}, threading.Event())
    assert (tmp_path / "cell.toml").read_text() == "kept"


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


async def test_an_absent_port_is_reported_with_the_gauge_and_an_action(links):
    link = links.acquire("/dev/absent-port", "x", {})
    with pytest.raises(DeviceError) as caught:
        await link.open()
    text = "gauge x: port /dev/absent-port is absent. Plug it in or correct port in the cell file"
    assert str(caught.value) == text
    assert caught.value.exit_code is ExitCode.HARDWARE


async def test_a_port_in_use_is_reported():
    near, far = os.openpty()
    url = os.ttyname(far)
    one, two = await opened(url, exclusive=True), link_to(url, {"exclusive": True})
    with pytest.raises(DeviceError, match="is in use"):
        await two.open()
    await one.close()
    await two.close()
    os.close(near)
    os.close(far)


async def test_a_terminal_marks_bytes_of_wrong_parity_and_opens_again():
    """Of a pseudo-terminal that refuses a second opening with parity, see pyserial's issue 196."""
    near, far = os.openpty()
    for _ in range(2):
        link = link_to(os.ttyname(far), {"bytesize": 7, "parity": "E", "stopbits": 2})
        await link.open()
        flags = termios.tcgetattr(far)[0]
        assert flags & termios.INPCK
        assert flags & termios.PARMRK
        assert not flags & termios.IGNPAR
        await link.close()
    os.close(near)
    os.close(far)


async def test_a_pseudo_terminal_that_refuses_parity_is_reported(fake):
    port = fake(FakePort())
    port.open = Mock(side_effect=termios.error(errno.EINVAL, "Invalid argument"))
    link = link_to("fake", {"bytesize": 7, "parity": "E", "stopbits": 2})
    with pytest.raises(DeviceError, match="cannot be opened"):
        await link.open()


@pytest.mark.parametrize(
    "broken",
    [
        serial.SerialException("device reports readiness to read but returned no data"),
        serial.SerialTimeoutException("Write timeout"),
        OSError(errno.EIO, "Input/output error"),
        termios.error(errno.EIO, "Input/output error"),
    ],
)
async def test_a_port_that_breaks_is_lost_until_it_is_opened_again(fake, broken):
    port = fake(FakePort())
    link = await opened()
    port.broken = broken
    with pytest.raises(DeviceError, match="was lost") as caught:
        await link.exchange(b"?\r", b"\r", LONG_S)
    assert caught.value.action is not None
    assert not port.is_open
    port.broken = None
    with pytest.raises(DeviceError, match="was lost"):
        await link.exchange(b"?\r", b"\r", LONG_S)
    assert link.line.open_count == 1
    assert await link.open() == 2
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"


async def test_opening_an_open_port_is_no_new_session(fake):
    port = fake(FakePort())
    link = await opened()
    port.due = [(0.0, b"SY276.1\r")]
    assert await link.open() == 1
    assert link.take_unsolicited() == b"SY276.1\r"


async def test_opening_detects_that_an_open_port_has_been_lost(fake):
    port = fake(FakePort())
    link = await opened()
    port.broken = OSError(errno.EIO, "Input/output error")
    monitor = port.close

    def replug():
        monitor()
        port.broken = None

    port.close = replug
    assert await link.open() == 2
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
