"""What holds for every test: nothing is left behind, and hypothesis repeats itself in CI."""

import asyncio
import contextlib
import fnmatch
import gc
import inspect
import os
import re
import shutil
import signal
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from unittest.mock import AsyncMock

import pytest
from hypothesis import settings

from tests.turns import LONG_TESTS, TURN, TURNS, not_there, turn, whose_turn_it_is_not

GRACE_S = 90.0  # for what is on its way out when a test returns; only a test that fails waits so long
TESTS = Path(__file__).parent
BENCHMARKS = TESTS / "benchmarks"
_KEPT_OPEN = re.compile(r"/mpl-data/|\.so(\.[0-9.]+)?$")

# As in the program and the Makefile: threads only slow small matrices down. Numpy is imported later.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Runs write each event through to the disk, which takes longer than the rest of them.
MEMORY = Path("/dev/shm")
if MEMORY.is_dir() and shutil.disk_usage(MEMORY).free > 1_000_000_000:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))

settings.register_profile(
    "hexacell",
    deadline=None,  # a shared machine is slow now and then
    max_examples=50,
    derandomize="CI" in os.environ,
    print_blob=True,
)
settings.load_profile("hexacell")


def pytest_report_header() -> str:
    return f"long tests: those of turn {turn()} ({TURN}=0 to {TURNS - 1})"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Whatever lies in tests/benchmarks is a benchmark; tests of the whole project come first.

    They are the longest, and the processes that share the tests should end together. Of tests with a
    ``sample`` of their parameters the others are slow, and so are long tests whose turn it is not.
    """
    for item in whose_turn_it_is_not(items):
        item.add_marker(pytest.mark.slow)
    patterns: set[tuple[str, str]] = set()
    taken: set[tuple[str, str]] = set()
    for item in items:
        if BENCHMARKS in item.path.parents:
            item.add_marker(pytest.mark.benchmark)
        if sample := item.get_closest_marker("sample"):
            test, _, parameters = item.nodeid.removesuffix("]").partition("[")
            found = {(test, one) for one in sample.args if fnmatch.fnmatchcase(parameters, one)}
            patterns, taken = patterns | {(test, one) for one in sample.args}, taken | found
            if not found:
                item.add_marker(pytest.mark.slow)
    if any("::" in argument for argument in config.args):
        return
    if patterns != taken:
        raise pytest.UsageError(
            f"these samples name no parameters of their tests: {sorted(patterns - taken)}"
        )
    if gone := not_there(items):
        raise pytest.UsageError(f"{LONG_TESTS.name} lists tests that are not there: {sorted(gone)}")
    items.sort(key=lambda item: item.path.parent != TESTS)


# Nearly all that tests leave goes by its count of references: to look for circles after every 700 objects
# takes a tenth of the time.
gc.set_threshold(50_000)


def pytest_collection_finish() -> None:
    """What was collected stays until the end: looking for garbage in it again and again takes seconds."""
    gc.freeze()


@pytest.fixture
def records_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """For runs without records, which tests write: what they propose counts as what records give."""
    monkeypatch.setattr("hexacell.services.write_back.proposals.require_as_recorded", AsyncMock())


@pytest.fixture(scope="module")
def postgresql() -> Iterator[str]:
    """The address of an empty database of a real server; the tests are skipped where none is installed."""
    from tests.hexacell.runs.postgresql_server import HOW_TO, installed_programs, running_server

    programs = installed_programs()
    if programs is None:
        pytest.skip(HOW_TO)
    with running_server(programs) as url:
        yield url


@pytest.fixture(autouse=True)
def nothing_left_open() -> Iterator[None]:
    """Fail a test that leaves a thread, a file, a socket, a terminal or a blocked signal behind."""
    before = _threads() | _descriptors() | _blocked_signals()
    yield
    give_up = time.monotonic() + GRACE_S
    while left := (_threads() | _descriptors() | _blocked_signals()) - before:
        if time.monotonic() > give_up:
            pytest.fail(f"left behind: {', '.join(sorted(left))}", pytrace=False)
        gc.collect()
        time.sleep(0.01)


@pytest.fixture(autouse=True)
def no_task_left_running(nothing_left_open: None, request: pytest.FixtureRequest) -> None:
    """For tests with an event loop: to make one for each of the others takes longer than most of them."""
    item = request.node
    if isinstance(item, pytest.Function):
        fixtures = (found[-1].func for found in item._fixtureinfo.name2fixturedefs.values())
        if any(map(_is_asynchronous, (item.function, *fixtures))):
            request.getfixturevalue("watched_tasks")


def _is_asynchronous(function: Callable[..., object]) -> bool:
    return inspect.iscoroutinefunction(function) or inspect.isasyncgenfunction(function)


@pytest.fixture
async def watched_tasks() -> AsyncIterator[None]:
    """Fail a test whose tasks outlive it and its fixtures; the event loop would cancel them unseen."""
    yield
    give_up = time.monotonic() + GRACE_S
    while left := [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]:
        if time.monotonic() > give_up:
            pytest.fail(f"left behind: {', '.join(map(str, left))}", pytrace=False)
        await asyncio.sleep(0.01)


def _threads() -> set[str]:
    return {
        f"{'daemon ' if thread.daemon else ''}thread {thread.name} ({thread.ident})"
        for thread in threading.enumerate()
    }


def _blocked_signals() -> set[str]:
    return {f"{number!r} blocked" for number in signal.pthread_sigmask(signal.SIG_BLOCK, ())}


def _descriptors() -> set[str]:
    """Every open file descriptor and what it refers to; none where there is no /proc.

    Without what is opened once and kept: matplotlib's fonts, and libraries that a library loads.
    """
    found = {}
    for descriptor in Path("/proc/self/fd").glob("*"):
        with contextlib.suppress(FileNotFoundError):  # the one that lists the folder
            found[descriptor.name] = str(descriptor.readlink())
    return {f"descriptor {name} -> {file}" for name, file in found.items() if not _KEPT_OPEN.search(file)}
