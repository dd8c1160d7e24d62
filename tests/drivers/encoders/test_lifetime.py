"""Opening, closing and cancelling: no threads are left, and samples stay synchronized."""

import asyncio
import threading
from unittest.mock import Mock

import can
import pytest

from drivers.errors import BusError
from hexacell.errors import DeviceError
from tests.drivers.encoders.conftest import short_timeout
from tests.waiting import cancel, until


async def test_a_cancelled_read_returns_soon_and_the_next_one_is_right(raw, make_bank):
    bank = make_bank(timeout_s=3600.0)
    await bank.open()
    release = threading.Event()

    held = threading.Event()

    def hold(_sync):
        held.set()
        release.wait()
        return [b"\x01\0\0\0"]

    raw.nodes[1].answers_sync = hold
    reading = asyncio.ensure_future(bank.read())
    await until(held.is_set)
    await cancel(reading)
    raw.nodes[1].answers_sync = lambda sync: [b"\x02\0\0\0"]
    release.set()
    assert (await bank.read()).counts == (2, 2000, 3000, 4000, 5000, 6000)


async def test_a_cancelled_open_leaves_nothing(raw, bank):
    before = set(threading.enumerate())
    answer = raw.nodes[1].answer_sdo
    asked, cancelled = threading.Event(), threading.Event()

    def answer_slowly(request):
        asked.set()
        cancelled.wait()
        return answer(request)

    raw.nodes[1].answer_sdo = answer_slowly
    opening = asyncio.ensure_future(bank.open())
    await until(asked.is_set)
    opening.cancel()
    asyncio.get_running_loop().call_soon(cancelled.set)
    with pytest.raises(asyncio.CancelledError):
        await opening
    left = {thread for thread in set(threading.enumerate()) - before if "asyncio" not in thread.name}
    assert not left
    with pytest.raises(DeviceError, match="not open"):
        await bank.read()
    raw.nodes[1].answer_sdo = answer
    await bank.open()


async def test_closing_ends_reads_in_progress(raw, make_bank):
    bank = make_bank(timeout_s=3600.0)
    await bank.open()
    raw.nodes[1].answers_sync = lambda _: []
    readings = [asyncio.ensure_future(bank.read()) for _ in range(3)]
    await until(lambda: raw.syncs > 0)
    await bank.close()
    results = await asyncio.gather(*readings, return_exceptions=True)
    assert all(isinstance(result, DeviceError) for result in results)


@pytest.mark.parametrize("where", ["recv", "send"])
async def test_a_bus_that_fails_is_an_error_with_its_cause(raw, opened, monkeypatch, where):
    network = opened._session.bus.network
    monkeypatch.setattr(network.bus, where, Mock(side_effect=can.CanOperationError("adapter gone")))
    for _ in range(2):
        failed = pytest.raises(BusError, match=r"bus virtual raw-.*adapter gone.*the set .* is void")
        with short_timeout(opened), failed:
            await opened.read()
