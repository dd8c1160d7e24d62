"""Tasks of a study: by any executor, each once, also where workers die."""

import os
import signal
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context, resource_tracker
from pathlib import Path

import pytest

from hexacell.study.tasks import MOST_LOSSES, WorkersLost, results_of

SQUARES = range(100)


def square(number: int) -> int:
    return number * number


def square_unless_killed(number: int, folder: Path) -> int:
    """The first to come to 50 ends its process, as one does that has no memory left."""
    if number == 50 and not (folder / "killed").exists():
        (folder / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def fail(number: int) -> int:
    raise ValueError(number)


class Broken(Executor):
    """One whose workers die before they have done anything."""

    def submit(self, function, /, *arguments, **named):
        future: Future = Future()
        future.set_exception(BrokenExecutor())
        return future


@pytest.fixture(scope="module", autouse=True)
def _tracker() -> None:
    """A process that Python keeps beside all that it spawns."""
    resource_tracker.ensure_running()


def test_every_task_is_done_once() -> None:
    found = list(results_of(SQUARES, square, partial(ThreadPoolExecutor, 3)))
    assert len(found) == 100
    assert dict(found) == {number: number**2 for number in SQUARES}


def test_tasks_that_a_killed_worker_loses_are_done_again(tmp_path: Path) -> None:
    carry_out = partial(square_unless_killed, folder=tmp_path)
    new_executor = partial(ProcessPoolExecutor, 2, get_context("spawn"))
    found = list(results_of(SQUARES, carry_out, new_executor))
    assert (tmp_path / "killed").exists()
    assert len(found) == 100
    assert dict(found) == {number: number**2 for number in SQUARES}


def test_workers_that_always_die_or_a_task_that_raises_end_the_study() -> None:
    with pytest.raises(WorkersLost, match=f"{MOST_LOSSES} sets of workers ended without a result"):
        list(results_of(SQUARES, square, Broken))
    with pytest.raises(ValueError, match="0"):
        list(results_of([0], fail, partial(ThreadPoolExecutor, 1)))
