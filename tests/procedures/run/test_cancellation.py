"""Shielded work is completed despite cancellation."""

import asyncio

import pytest

from hexacell.errors import DeviceError
from procedures.run.cancellation import shielded


async def work(turns: int, done: list[int]) -> int:
    for _ in range(turns):
        await asyncio.sleep(0)
    done.append(turns)
    return turns


@pytest.mark.parametrize("times", [1, 2, 4])
async def test_shielded_work_is_completed_before_the_cancellation_is_raised(times: int) -> None:
    done: list[int] = []
    task = asyncio.create_task(shielded(work(8, done)))
    for _ in range(times):
        await asyncio.sleep(0)
        task.cancel()
    assert done == []
    with pytest.raises(asyncio.CancelledError):
        await task
    assert done == [8]


async def test_an_error_of_cancelled_shielded_work_is_raised() -> None:
    cancelled = asyncio.Event()

    async def fail() -> None:
        await cancelled.wait()
        raise DeviceError("broken")

    task = asyncio.create_task(shielded(fail()))
    await asyncio.sleep(0)
    task.cancel()
    cancelled.set()
    with pytest.raises(DeviceError):
        await task
