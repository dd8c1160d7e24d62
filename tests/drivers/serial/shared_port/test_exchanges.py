"""Frames, requests and answers stay synchronized, also with late or missing answers and cancellations."""

import asyncio
import threading

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from drivers.serial.request_port import FRAME_LIMIT, LINE_ENDS, NoAnswer, cut_frame
from hexacell.errors import DeviceError
from tests.drivers.serial.shared_port.conftest import (
    FOREVER_S,
    LONG_S,
    SOON_S,
    WORST_LATENCY_S,
    FakePort,
    link_to,
    opened,
    written,
)
from tests.waiting import cancel, until


async def test_an_answer_is_complete_and_read_by_one_thread(fake):
    port = fake(FakePort(lambda _: [(0.0, b"+1."), (0.01, b"234"), (0.02, b"\r")]))
    link = await opened()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"+1.234\r"
    await link.close()
    assert port.threads == {"serial fake"}
    assert not port.is_open


@pytest.mark.parametrize(
    ("received", "timeout_s"), [(b"+1.2", SOON_S), (b"x" * (FRAME_LIMIT + 1), LONG_S)], ids=["few", "many"]
)
async def test_received_bytes_are_limited_and_reported_if_there_is_no_answer(fake, received, timeout_s):
    fake(FakePort(lambda _: [(0.0, received)]))
    link = await opened()
    with pytest.raises(NoAnswer) as caught:
        await link.exchange(b"?\r", b"\r", timeout_s)
    assert caught.value.received == received


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


async def test_a_late_answer_is_never_taken_for_that_to_the_next_request(fake):
    answers = iter([[(3 * SOON_S, b"late\r")], [(0.0, b"second\r")], [(0.0, b"third\r")]])
    fake(FakePort(lambda _: next(answers)))
    link = await opened()
    with pytest.raises(NoAnswer):
        await link.exchange(b"1\r", b"\r", SOON_S)
    assert await link.exchange(b"2\r", b"\r", LONG_S) == b"second\r"
    assert link.take_unsolicited() == b"late\r"
    assert await link.exchange(b"3\r", b"\r", LONG_S) == b"third\r"


async def test_nothing_is_sent_until_no_late_answer_can_come(fake):
    port = fake(FakePort(lambda request: [] if request == b"1\r" else [(0.0, b"b\r")]))
    link = await opened()
    with pytest.raises(NoAnswer):
        await link.exchange(b"1\r", b"\r", SOON_S)
    await link.exchange(b"2\r", b"\r", LONG_S)
    assert port.asked == [b"1\r", b"2\r"]
    assert port.asked_at_s[1] - port.asked_at_s[0] >= WORST_LATENCY_S


async def test_unsolicited_bytes_are_kept_apart(fake):
    port = fake(FakePort(lambda _: [(0.0, b"answer\r")]))
    link = await opened()
    port.due = [(0.0, b"SY276.1\r"), (port.time.now_s + SOON_S, b"more\r")]
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"answer\r"
    assert link.take_unsolicited() == b"SY276.1\rmore\r"
    assert link.take_unsolicited() == b""


async def test_a_second_frame_after_the_answer_does_not_answer_the_next_request(fake):
    answers = iter([b"one\rkey\r", b"two\r"])
    fake(FakePort(lambda _: [(0.0, next(answers))]))
    link = await opened()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"one\r"
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"two\r"
    assert link.take_unsolicited() == b"key\r"


async def test_silence_is_awaited_after_a_garbled_frame(fake):
    answers = iter([[(0.0, b"gar\r"), (0.02, b"bage\r")], [(0.0, b"two\r")]])
    fake(FakePort(lambda _: next(answers)))
    link = await opened()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"gar\r"
    link.require_silence()
    assert await link.exchange(b"?\r", b"\r", LONG_S) == b"two\r"


async def test_a_device_that_never_falls_silent_is_refused(fake):
    port = fake(FakePort())
    link = await opened()
    port.due = [(port.time.now_s + number * SOON_S, b"+1.234\r") for number in range(100)]
    with pytest.raises(DeviceError, match="keeps sending unasked"):
        await link.exchange(b"?\r", b"\r", LONG_S)
    assert port.asked == []


async def test_a_cancelled_exchange_leaves_the_port_synchronized(fake):
    answering = threading.Event()
    port = fake(FakePort(lambda request: [(SOON_S, b"to " + request)] * answering.wait()))
    link = await opened()
    first = asyncio.create_task(link.exchange(b"1\r", b"\r", FOREVER_S))
    await written(port)
    await cancel(first)
    answering.set()
    assert await link.exchange(b"2\r", b"\r", FOREVER_S) == b"to 2\r"
    assert link.take_unsolicited() == b""


async def test_an_exchange_cancelled_before_its_turn_sends_nothing(fake):
    answering = threading.Event()
    port = fake(FakePort(lambda request: [(SOON_S, b"to " + request)] * answering.wait()))
    link = await opened()
    first = asyncio.create_task(link.exchange(b"1\r", b"\r", FOREVER_S))
    await written(port)
    second = asyncio.create_task(link.exchange(b"2\r", b"\r", FOREVER_S))
    await asyncio.sleep(0)
    second.cancel()
    answering.set()
    assert await first == b"to 1\r"
    assert await link.exchange(b"3\r", b"\r", FOREVER_S) == b"to 3\r"
    assert port.asked == [b"1\r", b"3\r"]


async def test_closing_does_not_wait_for_an_answer(fake):
    port = fake(FakePort(lambda _: []))
    link = await opened()
    waiting = asyncio.create_task(link.exchange(b"?\r", b"\r", FOREVER_S))
    await written(port)
    await link.close()
    with pytest.raises(DeviceError, match="is closed"):
        await waiting
    assert not port.is_open


async def test_closing_does_not_wait_for_silence(fake):
    fake(FakePort(lambda _: []))
    link = link_to("fake", {}, worst_latency_s=FOREVER_S)
    await link.open()
    with pytest.raises(NoAnswer):
        await link.exchange(b"?\r", b"\r", SOON_S)
    waiting = asyncio.create_task(link.exchange(b"?\r", b"\r", FOREVER_S))
    await asyncio.sleep(0)
    await link.close()
    with pytest.raises(DeviceError, match="is closed"):
        await waiting


async def test_a_cancelled_close_closes_all_the_same(fake):
    port = fake(FakePort(lambda _: []))
    link = await opened()
    closing = asyncio.create_task(link.close())
    await asyncio.sleep(0)
    await cancel(closing)
    await until(lambda: not port.is_open)


plain = st.binary(max_size=20).filter(lambda data: not set(data) & set(LINE_ENDS))
ends = st.sampled_from([b"", b"\r", b"\n", b"\r\n", b"\0", b"\0\0\r\n"])


def test_no_frame_until_it_is_complete_and_the_echo_of_the_request_is_none() -> None:
    assert cut_frame(b"", b"?\r", b"\r") is None
    assert cut_frame(b"+1.23", b"?\r", b"\r") is None
    assert cut_frame(b"?", b"?\r", b"\r") is None
    assert cut_frame(b"?\r", b"?\r", b"\r") is None
    assert cut_frame(b"?\r+1.234\r", b"?\r", b"\r") == (b"+1.234\r", b"")
    assert cut_frame(b"R\r\n+1, MM\r\n", b"R\r", b"\r\n") == (b"+1, MM\r\n", b"")
    assert cut_frame(b"M0\rM0,+001.0000\r\n", b"M0\r\n", b"\r") == (b"M0,+001.0000\r", b"\n")
    assert cut_frame(b"911\r", b"9\r", b"\r") == (b"911\r", b"")
    assert cut_frame(b"M0,+001.0000\r\n", b"M0\r\n", b"\r") == (b"M0,+001.0000\r", b"\n")


@given(
    ends, st.booleans(), ends, plain.filter(lambda frame: frame not in {b"", b"?"}), st.binary(max_size=20)
)
def test_a_frame_is_found_behind_line_ends_and_echo(before, echoed, between, frame, rest):
    echo = b"?\r" if echoed else b""
    received = before + echo + between + frame + b"\r" + rest
    assert cut_frame(received, b"?\r", b"\r") == (frame + b"\r", rest)


@given(st.binary(max_size=60))
def test_a_frame_consists_of_received_bytes(noise):
    cut = cut_frame(noise, b"?\r", b"\r")
    if cut is not None:
        assert noise.endswith(cut[0] + cut[1])
        assert cut[0].count(b"\r") == 1
