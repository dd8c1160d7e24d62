"""One owner thread, exchanges in step, and every failure of a port in plain words."""

import asyncio
import errno
import os
import termios
import threading
import time

import pytest
import serial

from drivers.link import SerialLink, SerialLinks
from drivers.port_errors import cannot_open
from drivers.trace import Direction, WireTrace
from drivers.wire import FRAME_LIMIT, NoAnswer
from hexacell.errors import DeviceError, ExitCode, FileError

WORST_LATENCY_S = 0.3
SOON_S = 0.05
LONG_S = 30.0
SLICE_S = 0.005


class FakePort:
    """Delivers what ``answer`` says for each question, each part after its delay."""

    def __init__(self, answer=lambda request: [(0.0, b"+1.234\r")]):
        self.is_open = False
        self.asked = []
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
        return sum(len(data) for due, data in self.due if due <= time.monotonic())

    def read(self, size):
        self._fail()
        if not self.in_waiting:
            time.sleep(SLICE_S)
        here = b"".join(data for due, data in self.due if due <= time.monotonic())
        later = [(due, data) for due, data in self.due if due > time.monotonic()]
        self.due = [(0.0, here[size:])] * bool(here[size:]) + later
        return here[:size]

    def write(self, request):
        self._fail()
        self.threads.add(threading.current_thread().name)
        self.asked.append(request)
        self.due += [(time.monotonic() + delay, data) for delay, data in self._answer(request)]
        self.written.set()

    def _fail(self):
        if self.broken is not None:
            raise self.broken


@pytest.fixture
def fake(monkeypatch):
    """Make every URL lead to a given fake port, and note how it was asked for."""

    def install(port):
        def serial_for_url(url, *, do_not_open, **settings):
            assert do_not_open
            port.url, port.settings = url, settings
            return port

        monkeypatch.setattr(serial, "serial_for_url", serial_for_url)
        return port

    return install


@pytest.fixture
async def links():
    links = SerialLinks(worst_latency_s=WORST_LATENCY_S)
    yield links
    await links.close()


async def opened(url="fake", **settings):
    link = SerialLink(url, worst_latency_s=WORST_LATENCY_S, **settings)
    await link.open()
    return link


async def written(port):
    await asyncio.to_thread(port.written.wait, LONG_S)


# Questions and answers


async def test_an_answer_comes_back_whole_and_from_one_thread(fake):
    port = fake(FakePort(lambda _: [(0.0, b"+1."), (0.01, b"234"), (0.02, b"\r")]))
    link = await opened()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    await link.close()
    assert port.threads == {"serial fake_0"}
    assert not port.is_open


async def test_what_came_is_told_when_no_answer_does(fake):
    fake(FakePort(lambda _: [(0.0, b"+1.2")]))
    link = await opened()
    with pytest.raises(NoAnswer, match=r"no answer within 0\.05 s") as caught:
        await link.exchange(b"?\r", b"\r", SOON_S)
    assert caught.value.received == b"+1.2"
    await link.close()


@pytest.mark.parametrize("sent", [True, False])
async def test_a_write_that_took_too_long_is_judged_by_its_answer(fake, sent):
    """A busy machine may be late to notice that it has sent; the port is not lost by that."""
    port = fake(FakePort())
    real = port.write

    def write(request):
        if sent:
            real(request)
        raise serial.SerialTimeoutException("Write timeout")

    port.write = write
    link = await opened()
    if sent:
        assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    else:
        with pytest.raises(NoAnswer):
            await link.exchange(b"?\r", b"\r", SOON_S)
    assert port.is_open
    await link.close()


async def test_a_late_answer_is_never_the_answer_to_the_next_question(fake):
    answers = iter([[(3 * SOON_S, b"late\r")], [(0.0, b"second\r")], [(0.0, b"third\r")]])
    fake(FakePort(lambda _: next(answers)))
    link = await opened()
    with pytest.raises(NoAnswer):
        await link.exchange(b"1\r", b"\r", SOON_S)
    assert await link.exchange(b"2\r", b"\r", LONG_S) == b"second\r"
    assert link.take_strays() == b"late\r"
    assert await link.exchange(b"3\r", b"\r", LONG_S) == b"third\r"
    await link.close()


async def test_nothing_is_asked_until_a_late_answer_has_had_its_time(fake):
    port = fake(FakePort(lambda request: [] if request == b"1\r" else [(0.0, b"b\r")]))
    link = await opened()
    with pytest.raises(NoAnswer):
        await link.exchange(b"1\r", b"\r", SOON_S)
    began = time.monotonic()
    await link.exchange(b"2\r", b"\r", LONG_S)
    assert time.monotonic() - began > WORST_LATENCY_S - 2 * SOON_S
    assert port.asked == [b"1\r", b"2\r"]
    await link.close()


async def test_what_nobody_asked_for_is_put_aside(fake):
    port = fake(FakePort(lambda _: [(0.0, b"answer\r")]))
    link = await opened()
    port.due = [(0.0, b"SY276.1\r"), (time.monotonic() + SOON_S, b"more\r")]
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"answer\r"
    assert link.take_strays() == b"SY276.1\rmore\r"
    assert link.take_strays() == b""
    await link.close()


async def test_a_second_frame_behind_the_answer_does_not_answer_the_next_question(fake):
    answers = iter([b"one\rkey\r", b"two\r"])
    fake(FakePort(lambda _: [(0.0, next(answers))]))
    link = await opened()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"one\r"
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"two\r"
    assert link.take_strays() == b"key\r"
    await link.close()


async def test_a_distrusted_frame_is_followed_by_silence(fake):
    answers = iter([[(0.0, b"gar\r"), (0.02, b"bage\r")], [(0.0, b"two\r")]])
    fake(FakePort(lambda _: next(answers)))
    link = await opened()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"gar\r"
    link.distrust()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"two\r"
    await link.close()


async def test_a_flood_without_an_end_is_cut_off(fake):
    fake(FakePort(lambda _: [(0.0, b"x" * (FRAME_LIMIT + 1))]))
    link = await opened()
    with pytest.raises(NoAnswer) as caught:
        await link.exchange(b"?\r", b"\r", LONG_S)
    assert len(caught.value.received) == FRAME_LIMIT + 1
    await link.close()


async def test_a_device_that_never_falls_silent_is_refused(fake):
    port = fake(FakePort())
    link = await opened()
    now = time.monotonic()
    port.due = [(now + number * SOON_S, b"+1.234\r") for number in range(100)]
    await asyncio.sleep(SOON_S)
    with pytest.raises(DeviceError, match="keeps sending unasked"):
        await link.exchange(b"?\r", b"\r", LONG_S)
    assert port.asked == []
    await link.close()


async def test_only_our_own_question_back_is_no_answer():
    link = await opened("loop://")
    with pytest.raises(NoAnswer) as caught:
        await link.exchange(b"?\r", b"\r", SOON_S)
    assert caught.value.received == b"?\r"
    await link.close()


async def test_every_byte_is_traced(fake):
    trace = WireTrace()
    fake(FakePort(lambda _: [(0.0, b"?\r+1.234\r")]))
    link = SerialLink("fake", trace=trace)
    await link.open()
    await link.exchange(b"?\r", b"\r", LONG_S)
    await link.close()
    assert [(each.line, each.direction, each.data) for each in trace.entries()] == [
        ("fake", Direction.SENT, b"?\r"),
        ("fake", Direction.RECEIVED, b"?\r+1.234\r"),
    ]


# Cancelling and closing


async def test_a_cancelled_exchange_leaves_the_link_in_step(fake):
    port = fake(FakePort(lambda request: [(SOON_S, b"to " + request)]))
    link = await opened()
    first = asyncio.create_task(link.exchange(b"1\r", b"\r", LONG_S))
    await written(port)
    first.cancel()
    with pytest.raises(asyncio.CancelledError):
        await first
    assert await link.exchange(b"2\r", b"\r", LONG_S) == b"to 2\r"
    assert link.take_strays() == b""
    await link.close()


async def test_an_exchange_that_is_cancelled_before_its_turn_is_never_asked(fake):
    port = fake(FakePort(lambda request: [(SOON_S, b"to " + request)]))
    link = await opened()
    first = asyncio.create_task(link.exchange(b"1\r", b"\r", LONG_S))
    await written(port)
    second = asyncio.create_task(link.exchange(b"2\r", b"\r", LONG_S))
    await asyncio.sleep(0)
    second.cancel()
    assert await first == b"to 1\r"
    assert await link.exchange(b"3\r", b"\r", LONG_S) == b"to 3\r"
    assert port.asked == [b"1\r", b"3\r"]
    await link.close()


async def test_exchanges_at_once_take_their_turns(fake):
    fake(FakePort(lambda request: [(0.01, b"to " + request)]))
    link = await opened()
    requests = [b"%d\r" % number for number in range(10)]
    answers = await asyncio.gather(*(link.exchange(each, b"\r", LONG_S) for each in requests))
    assert answers == [b"to " + each for each in requests]
    await link.close()


async def test_closing_does_not_wait_for_an_answer(fake):
    port = fake(FakePort(lambda _: []))
    link = await opened()
    waiting = asyncio.create_task(link.exchange(b"?\r", b"\r", LONG_S))
    await written(port)
    await asyncio.wait_for(link.close(), LONG_S / 10)
    with pytest.raises(DeviceError, match="is closed"):
        await waiting
    assert not port.is_open


async def test_closing_does_not_wait_for_silence(fake):
    fake(FakePort(lambda _: []))
    link = SerialLink("fake", worst_latency_s=LONG_S)
    await link.open()
    with pytest.raises(NoAnswer):
        await link.exchange(b"?\r", b"\r", SOON_S)
    waiting = asyncio.create_task(link.exchange(b"?\r", b"\r", LONG_S))
    await asyncio.sleep(0)
    await asyncio.wait_for(link.close(), LONG_S / 10)
    with pytest.raises(DeviceError, match="is closed"):
        await waiting


async def test_a_cancelled_close_closes_all_the_same(fake):
    port = fake(FakePort(lambda _: []))
    link = await opened()
    closing = asyncio.create_task(link.close())
    await asyncio.sleep(0)
    closing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await closing
    give_up = time.monotonic() + LONG_S
    while port.is_open and time.monotonic() < give_up:  # noqa: ASYNC110 - a thread closes it
        await asyncio.sleep(SLICE_S)
    assert not port.is_open


async def test_closing_twice_is_harmless_and_using_it_afterwards_is_not(fake):
    fake(FakePort())
    link = await opened()
    await link.close()
    await link.close()
    link.distrust()
    with pytest.raises(DeviceError, match="is closed"):
        await link.exchange(b"?\r", b"\r", LONG_S)
    with pytest.raises(DeviceError, match="is closed"):
        await link.open()


async def test_a_link_that_was_never_opened_closes_and_does_not_ask(fake):
    port = fake(FakePort())
    link = SerialLink("fake")
    with pytest.raises(DeviceError, match="it is not open"):
        await link.exchange(b"?\r", b"\r", LONG_S)
    await link.close()
    assert port.asked == []


# Ports that fail


async def test_an_absent_port_is_told_with_the_gauge_and_what_to_do(links):
    link = links.acquire("/dev/absent-port", "x", {})
    with pytest.raises(DeviceError) as caught:
        await link.open()
    text = "gauge x: port /dev/absent-port is absent. Plug it in or correct port in the cell file"
    assert str(caught.value) == text
    assert caught.value.exit_code is ExitCode.HARDWARE


async def test_a_refused_connection_is_told():
    link = SerialLink("socket://127.0.0.1:1")
    with pytest.raises(DeviceError, match="cannot be opened"):
        await link.open()
    await link.close()


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.ENOENT, "is absent"),
        (errno.EACCES, "may not be opened by this user"),
        (errno.EBUSY, "is in use"),
        (errno.EAGAIN, "is in use"),
        (errno.EIO, "cannot be opened"),
    ],
)
def test_the_cause_is_told_in_words(number, words):
    error = cannot_open("gauge x", "/dev/ttyUSB0", serial.SerialException(number, "reason"))
    assert words in str(error)
    assert error.action


async def test_a_port_in_use_is_told():
    near, far = os.openpty()
    url = os.ttyname(far)
    one, two = await opened(url, exclusive=True), SerialLink(url, exclusive=True)
    with pytest.raises(DeviceError, match="is in use"):
        await two.open()
    await one.close()
    await two.close()
    os.close(near)
    os.close(far)


async def test_a_pseudo_terminal_that_refuses_parity_is_told():
    near, far = os.openpty()
    for again in range(2):
        link = SerialLink(os.ttyname(far), bytesize=7, parity="E", stopbits=2)
        if again:  # the open that pyserial 196 is about, and nobody resets the speed here
            with pytest.raises(DeviceError, match="cannot be opened"):
                await link.open()
        else:
            await link.open()
        await link.close()
    os.close(near)
    os.close(far)


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
    assert link.session == 1
    assert await link.open() == 2
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    await link.close()


async def test_opening_an_open_port_is_no_new_session(fake):
    port = fake(FakePort())
    link = await opened()
    port.due = [(0.0, b"SY276.1\r")]
    assert await link.open() == 1
    assert link.take_strays() == b"SY276.1\r"
    await link.close()


async def test_opening_finds_out_that_an_open_port_has_died_unnoticed(fake):
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
    await link.close()


# Settings


async def test_settings_reach_pyserial_unchanged(fake):
    port = fake(FakePort())
    link = await opened("any://url?x=1", baudrate=4800, parity="E", xonxoff=True, timeout=99, rts=False)
    assert port.url == "any://url?x=1"
    assert port.settings == {"baudrate": 4800, "parity": "E", "xonxoff": True, "timeout": 99}
    assert port.rts is False
    assert port.timeout <= 0.2
    assert port.write_timeout <= 0.2
    await link.close()


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


# Sharing


async def test_gauges_on_one_port_share_a_link_until_the_last_lets_go(links, fake):
    port = fake(FakePort())
    x = links.acquire("fake", "x", {"baudrate": 9600}, channel=1)
    y = links.acquire("fake", "y", {"baudrate": 9600}, channel=2)
    assert x is y
    assert x.subject == "gauges x, y"
    await x.open()
    await links.release("fake", "x")
    await links.release("fake", "x")
    assert port.is_open
    assert x.subject == "gauge y"
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
async def test_what_cannot_be_shared_is_refused(links, settings, channel, words):
    first = links.acquire("loop://", "x", {"baudrate": 9600}, channel=1)
    with pytest.raises(FileError, match=words) as caught:
        links.acquire("loop://", "y", settings, channel=channel)
    assert caught.value.subject == "gauge y"
    assert first.subject == "gauge x"


async def test_a_port_of_ones_own_is_not_shared(links):
    links.acquire("loop://", "x", {})
    with pytest.raises(FileError, match="already belongs to gauge x"):
        links.acquire("loop://", "y", {}, channel=1)


async def test_closing_all_closes_what_is_still_held(links, fake):
    port = fake(FakePort())
    await links.acquire("fake", "x", {}).open()
    await links.close()
    assert not port.is_open
    await links.release("fake", "x")
