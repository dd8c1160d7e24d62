"""Around drivers: the worker thread with its jobs, and errors of libraries that name the device."""

import asyncio
import termios
import threading

import can
import pytest
import serial
from canopen import SdoCommunicationError

from drivers.errors import GaugeSilent, translated
from drivers.worker_thread import WorkerThread
from hexacell.errors import DeviceError


@pytest.fixture
async def worker():
    made = WorkerThread("worker")
    yield made
    await made.finish(lambda: None)


async def test_a_job_ends_before_the_next_one_begins_even_if_its_coroutine_is_cancelled(worker):
    begun, release, order = threading.Event(), threading.Event(), []

    def wait() -> None:
        begun.set()
        release.wait()
        order.append("first")

    first = asyncio.create_task(worker.run(wait))
    await asyncio.to_thread(begun.wait)
    dropped = asyncio.create_task(worker.run(lambda: order.append("dropped")))
    last = asyncio.create_task(worker.run(lambda: order.append("last")))
    await asyncio.sleep(0)
    first.cancel()
    dropped.cancel()
    await asyncio.wait([first, dropped])
    release.set()
    await last
    assert order == ["first", "last"]


async def test_finish_ends_the_jobs_runs_one_more_and_ends_the_thread():
    worker = WorkerThread("finished")
    order: list[object] = []
    waiting = asyncio.create_task(worker.run(lambda: order.append(worker.closing.wait())))
    await asyncio.sleep(0)
    await worker.finish(lambda: order.append("last"))
    await worker.finish(lambda: order.append("never"))
    await waiting
    assert order == [True, "last"]
    assert not any(thread.name.startswith("finished") for thread in threading.enumerate())


class Elsewhere:
    """A device whose calls fail as stated."""

    name = "x"

    def __init__(self, error: Exception | None) -> None:
        self.error = error

    async def read(self, value: float) -> float:
        if self.error is not None:
            raise self.error
        return value


@pytest.mark.parametrize(
    "error",
    [
        serial.SerialException("device disconnected"),
        can.CanOperationError("bus off"),
        SdoCommunicationError("no response"),
        termios.error(5, "Input/output error"),
        ConnectionResetError(104, "reset by peer"),
        TimeoutError("timed out"),
        EOFError("nothing more"),
    ],
    ids=lambda error: type(error).__name__,
)
async def test_errors_of_libraries_and_of_the_system_name_the_device(error: Exception) -> None:
    with pytest.raises(DeviceError, match="gauge x: its driver failed: ") as caught:
        await translated(Elsewhere(error), "gauge x").read(1.0)
    assert caught.value.__cause__ is error
    assert type(error).__name__ in str(caught.value)


@pytest.mark.parametrize("error", [GaugeSilent("is silent", subject="gauge x"), ZeroDivisionError("a bug")])
async def test_other_errors_stay_what_they_are(error: Exception) -> None:
    with pytest.raises(type(error)) as caught:
        await translated(Elsewhere(error), "gauge x").read(1.0)
    assert caught.value is error


async def test_everything_else_is_the_device() -> None:
    device = translated(Elsewhere(None), "gauge x")
    assert device.name == "x"
    assert await device.read(2.0) == 2.0
