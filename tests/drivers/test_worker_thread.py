"""The worker thread: order of jobs, cancelled coroutines, and its end."""

from __future__ import annotations

import asyncio
import threading

import pytest

from drivers.worker_thread import WorkerThread


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
