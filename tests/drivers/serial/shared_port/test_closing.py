"""Cancelling and closing do not wait for an answer."""

import asyncio
import threading

import pytest

from drivers.serial.request_port import NoAnswer
from hexacell.errors import DeviceError
from tests.drivers.serial.shared_port.fake_port import FOREVER_S, SOON_S, FakePort, link_to, opened, written
from tests.waiting import until


async def test_a_cancelled_exchange_leaves_the_port_synchronized(fake):
    answering = threading.Event()
    port = fake(FakePort(lambda request: [(SOON_S, b"to " + request)] * answering.wait()))
    link = await opened()
    first = asyncio.create_task(link.exchange(b"1\r", b"\r", FOREVER_S))
    await written(port)
    first.cancel()
    with pytest.raises(asyncio.CancelledError):
        await first
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
    closing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await closing
    await until(lambda: not port.is_open)
