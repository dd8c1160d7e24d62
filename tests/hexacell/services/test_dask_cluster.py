"""Tasks of a study on a real Dask cluster, whose processes are killed."""

import gc
import signal
from collections.abc import Iterator
from concurrent.futures import Executor
from functools import partial
from itertools import chain, repeat
from pathlib import Path

import pytest

from hexacell import __version__
from hexacell.errors import HexacellError, UsageError
from hexacell.study.tasks import NewExecutor, results_of
from tests.dask_processes import DaskProcesses, dask_processes
from tests.hexacell.study.test_tasks import SQUARES, fail, square, square_unless_killed
from tests.waiting import wait_until

GIVEN_UP_AT_ONCE = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
"""The scheduler gives no task of a lost worker to another one, so that this program must."""

NO_SCHEDULER = "{}: no Dask scheduler answers. Start one there"
NO_WORKERS = "{}: the Dask scheduler has no workers. Start some with `dask worker "
SOON_S = 1.0
LATE_S = 250.0


def dask_cluster(address: str, patience_s: float = LATE_S) -> NewExecutor:
    """Imported late: only the process that runs these tests needs the library, which takes long to load."""
    from hexacell.study.dask_cluster import dask_cluster as cluster_at

    return cluster_at(address, patience_s=patience_s)


def square_until_held(number: int, folder: Path) -> int:
    """From 50 on nothing ends before the test says so."""
    if number >= 50:
        (folder / "held").touch()
        wait_until((folder / "go").exists)
    return square(number)


def impatient_after_the_first(address: str) -> NewExecutor:
    """Executors of which the first waits for the cluster to start, and those after it not again."""
    executors = chain([dask_cluster(address)], repeat(dask_cluster(address, patience_s=SOON_S)))

    def next_one() -> Executor:
        return next(executors)()

    return next_one


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[DaskProcesses]:
    """Two workers."""
    with dask_processes(tmp_path, 2, **GIVEN_UP_AT_ONCE) as processes:
        yield processes


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskProcesses]:
    """Two workers for tests that leave them as they were."""
    with dask_processes(tmp_path_factory.mktemp("shared"), 2) as processes:
        yield processes


@pytest.mark.slow
def test_tasks_of_a_killed_worker_are_done_again(tmp_path: Path) -> None:
    with dask_processes(tmp_path, 3) as cluster:
        carry_out = partial(square_unless_killed, folder=tmp_path)
        found = list(results_of(SQUARES, carry_out, dask_cluster(cluster.address)))
        wait_until(lambda: any(worker.poll() == -signal.SIGKILL for worker in cluster.workers))
    assert len(found) == 100
    assert dict(found) == {number: number**2 for number in SQUARES}


def test_what_a_task_raises_ends_the_study_and_leaves_the_cluster_in_use(shared) -> None:
    with pytest.raises(ValueError, match="0"):
        list(results_of([0], fail, dask_cluster(shared.address)))
    assert dict(results_of([3], square, dask_cluster(shared.address))) == {3: 9}


def test_a_scheduler_that_goes_away_is_named_and_what_was_done_is_told(cluster, tmp_path: Path) -> None:
    carry_out = partial(square_until_held, folder=tmp_path)
    found = results_of(SQUARES, carry_out, impatient_after_the_first(cluster.address))
    done = dict(next(found) for _ in range(40))
    wait_until((tmp_path / "held").exists)
    cluster.scheduler.kill()
    with pytest.raises(HexacellError, match=NO_SCHEDULER.format(cluster.address)):
        done |= dict(found)
    assert all(done[key] == key**2 for key in done)


@pytest.mark.slow
def test_workers_that_all_leave_are_missed(cluster, tmp_path: Path) -> None:
    started = results_of([3], square, dask_cluster(cluster.address))
    assert dict(started) == {3: 9}
    carry_out = partial(square_until_held, folder=tmp_path)
    found = results_of(SQUARES, carry_out, dask_cluster(cluster.address, patience_s=SOON_S))
    next(found)
    wait_until((tmp_path / "held").exists)
    for worker in cluster.workers:
        worker.kill()
    with pytest.raises(HexacellError, match=NO_WORKERS.format(cluster.address)):
        list(found)


def test_a_study_that_is_given_up_waits_for_no_task(shared, tmp_path: Path) -> None:
    """As Ctrl-C does it: the workers are held still when this ends."""
    found = results_of(SQUARES, partial(square_until_held, folder=tmp_path), dask_cluster(shared.address))
    next(found)
    wait_until((tmp_path / "held").exists)
    found.close()  # type: ignore[attr-defined]
    (tmp_path / "go").touch()
    gc.collect()  # a connection that the library was just making is closed with its garbage


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("__version__ = '0.0.1'\n", f"has hexacell 0.0.1, this computer {__version__}. Install hexacell=="),
        pytest.param(
            "raise ImportError('numpy')\n",
            "has no hexacell that can be imported, this computer",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_worker_with_another_version_is_named(tmp_path: Path, content: str, words: str) -> None:
    """Before it is there, a scheduler without workers says how to start some."""
    (tmp_path / "other" / "hexacell").mkdir(parents=True)
    (tmp_path / "other" / "hexacell" / "__init__.py").write_text(content)
    with dask_processes(tmp_path, 0) as cluster:
        with pytest.raises(HexacellError, match=NO_WORKERS.format(cluster.address)):
            dask_cluster(cluster.address, patience_s=3.0)()
        cluster.start_worker(PYTHONPATH=str(tmp_path / "other"))
        with pytest.raises(HexacellError, match=rf"tcp://127.0.0.1:\d+: .*{words}"):
            dask_cluster(cluster.address)()


def test_a_worker_that_comes_later_with_another_version_is_named(shared, monkeypatch) -> None:
    executor = dask_cluster(shared.address)()
    monkeypatch.setattr("hexacell.study.dask_cluster.__version__", "9.9")
    with (
        executor,
        pytest.raises(HexacellError, match=rf"tcp://127.*: has hexacell {__version__}, the study 9.9"),
    ):
        executor.submit(square, 3).result()


def test_what_is_no_address_is_refused() -> None:
    for address in (
        *("", "here", "127.0.0.1:8786", "tcp://127.0.0.1"),
        *("tcp://:port", "tcp://host:65536", "tcp://[::1:8786"),
    ):
        with pytest.raises(UsageError, match="is not an address of a Dask scheduler"):
            dask_cluster(address)
