"""A Dask cluster as the executor of a study.

Its scheduler gives the tasks of a lost worker to other workers. What it gives up, and all that is under way
when the scheduler itself is lost, breaks the executor, and the study does it again with the next one.
"""

import asyncio
import logging
from collections.abc import Callable, Coroutine
from concurrent.futures import BrokenExecutor, Executor, Future
from concurrent.futures import wait as wait_for
from contextlib import suppress
from functools import partial
from pydoc import locate
from threading import Thread
from typing import Any, ParamSpec, TypeVar

import distributed
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker

from hexacell import __version__
from hexacell.addresses import address_of
from hexacell.errors import ExitCode, HexacellError, UsageError
from hexacell.study.tasks import NewExecutor

PATIENCE_S = 30.0
"""For a scheduler that does not answer, and for one that has no workers."""

CHECKS = 5
"""Number of checks, within that time, whether there are workers."""

CLOSING_S = 2.0

Parameters = ParamSpec("Parameters")
ResultType = TypeVar("ResultType")


class ClusterError(HexacellError):
    """The cluster does not do what it should; ``subject`` is its address or that of a worker."""

    exit_code = ExitCode.HARDWARE


def dask_cluster(address: str, *, patience_s: float = PATIENCE_S) -> NewExecutor:
    """Executors at the scheduler's ``address``, such as ``tcp://192.168.0.5:8786``.

    Making one raises ``ClusterError`` where the scheduler does not answer, has no workers, or where it or
    a worker has another version of this program.

    Raises:
        UsageError: this is not an address of a scheduler.
    """
    try:
        named = address_of(address)
        is_one = named.scheme in {"tcp", "tls"} and bool(named.hostname) and named.port is not None
    except UsageError:
        is_one = False
    if not is_one:
        raise UsageError(f"'{address}' is not an address of a Dask scheduler", action="Try tcp://HOST:8786")
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # the errors here say it in plain words
    return partial(ClusterExecutor, address, patience_s)


class LoopThread:
    """An event loop in a thread of its own, which the library needs, until it is closed."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._run, name="event loop", daemon=True)
        self._thread.start()

    @property
    def is_closed(self) -> bool:
        """Whether it can begin nothing any more."""
        return self._loop.is_closed()

    def begin(self, coroutine: Coroutine[Any, Any, ResultType]) -> Future[ResultType]:
        """Run a coroutine; cancelling the future cancels it."""
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop)

    def close(self) -> None:
        """End the loop and the thread; what is under way is cancelled."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.get_loop().run_forever()


class ClusterExecutor(Executor):
    """One connection to a cluster, broken when that is; waits ``patience_s`` for its answer and workers, s.

    Raises:
        ClusterError: it does not answer, has no workers, or another version of this program.
    """

    def __init__(self, address: str, patience_s: float) -> None:
        self._loop = LoopThread()
        self._begun: set[distributed.Future[Any]] = set()
        self._outcomes: set[Future[Any]] = set()
        try:
            self._client = self._loop.begin(_connect(address, patience_s)).result()
        except BaseException:
            self._loop.close()
            raise
        # Without this a study whose workers have all left would wait for ever.
        self._loop.begin(self._break_without_workers(patience_s))

    def submit(
        self,
        function: Callable[Parameters, ResultType],
        /,
        *arguments: Parameters.args,
        **named: Parameters.kwargs,
    ) -> Future[ResultType]:
        """Begin a task; its exception is ``BrokenExecutor`` where the cluster has lost it."""
        task = partial(_in_version, __version__, function, *arguments, **named)
        outcome = self._loop.begin(self._result_of(task))
        self._outcomes.add(outcome)
        outcome.add_done_callback(self._outcomes.discard)
        return outcome

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Close the connection, which cancels what is under way unless that is waited for."""
        if wait and not cancel_futures:
            wait_for(list(self._outcomes))
        if not self._loop.is_closed:
            self._loop.begin(_close(self._client)).result()
            self._loop.close()

    async def _result_of(self, task: Callable[[], ResultType]) -> ResultType:
        try:
            begun: distributed.Future[ResultType] = self._client.submit(task, pure=False)
        except Exception as error:
            raise BrokenExecutor(f"the scheduler accepts no tasks: {error}") from error
        self._begun.add(begun)
        try:
            result: ResultType = await begun
        except (Exception, FutureCancelledError) as error:
            if begun.status == "error" and not isinstance(error, KilledWorker):
                raise  # by the task itself
            raise BrokenExecutor(str(error)) from error
        finally:
            self._begun.discard(begun)
        return result

    async def _break_without_workers(self, patience_s: float) -> None:
        missed = 0
        while missed < CHECKS:
            await asyncio.sleep(patience_s / CHECKS)
            missed = 0 if await self._has_workers(patience_s) else missed + 1
        await self._client.cancel(list(self._begun), force=True)

    async def _has_workers(self, patience_s: float) -> bool:
        try:
            async with asyncio.timeout(patience_s):
                return bool(await self._client.nthreads())
        except Exception:
            # The connection is lost, which each task reports.
            return False


async def _connect(address: str, patience_s: float) -> distributed.Client:
    client = distributed.Client(address, timeout=patience_s, set_as_default=False, asynchronous=True)
    problem, start = "no Dask scheduler answers", "one there with `dask scheduler`, and workers"
    try:
        await client
        problem = "the Dask scheduler has no workers"
        start = f"some with `dask worker {address} --nthreads 1`"
        await client.wait_for_workers(1, timeout=patience_s)  # type: ignore[func-returns-value, misc]
        await _require_same_version(client, address)
    except BaseException as error:
        await _close(client)
        if isinstance(error, OSError | TimeoutError):
            action = f"Start {start}; results so far are kept"
            raise ClusterError(problem, subject=address, action=action) from error
        raise
    return client


async def _close(client: distributed.Client) -> None:
    with suppress(TimeoutError):  # of a scheduler that does not say good-bye
        async with asyncio.timeout(CLOSING_S):
            await client.close()


async def _require_same_version(client: distributed.Client, address: str) -> None:
    """Refuse a scheduler, which unpickles tasks too, and workers with another version, or without any.

    ``locate`` is of the standard library, so that they can be asked whatever they have.
    """
    ask = (locate, "hexacell.__version__")
    found = await client.run(*ask, on_error="return")
    found[address] = await client.run_on_scheduler(*ask)
    for place, version in found.items():
        # One that has left meanwhile says nothing.
        if version != __version__ and not isinstance(version, OSError):
            has = f"hexacell {version}" if isinstance(version, str) else "no hexacell that can be imported"
            problem = f"has {has}, this computer {__version__}"
            raise ClusterError(problem, subject=place, action=f"Install hexacell=={__version__} there")


def _in_version(
    version: str,
    function: Callable[Parameters, ResultType],
    *arguments: Parameters.args,
    **named: Parameters.kwargs,
) -> ResultType:
    """Carry a task out in a worker, which may have come later with another version."""
    if version != __version__:
        raise ClusterError(
            f"has hexacell {__version__}, the study {version}",
            subject=distributed.get_worker().address,
            action=f"Install hexacell=={version} there",
        )
    return function(*arguments, **named)
