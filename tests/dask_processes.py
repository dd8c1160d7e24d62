"""A Dask cluster on this computer: a scheduler and workers, each a process of its own."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.waiting import wait_until

CHECKOUT = Path(__file__).parent.parent


class DaskProcesses:
    """The processes of a cluster; their output goes into files of a folder.

    Attributes:
        address: of the scheduler.
        workers: in the order of their start.
    """

    def __init__(self, folder: Path, **settings: str) -> None:
        self._folder = folder
        self._environment = {**os.environ, "PYTHONPATH": str(CHECKOUT), **settings}
        self.workers: list[subprocess.Popen[bytes]] = []
        told = folder / "scheduler.json"
        local = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        self.scheduler = self._start("scheduler", *local, "--scheduler-file", str(told))
        wait_until(lambda: self.scheduler.poll() is not None or _is_whole(told))
        assert self.scheduler.poll() is None, (folder / "scheduler-0").read_text()
        self.address: str = json.loads(told.read_text())["address"]

    def start_worker(self, **settings: str) -> None:
        """Start another; nothing starts it anew when it dies."""
        alone = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(self._folder))
        self.workers.append(self._start("worker", self.address, *alone, **settings))

    def end(self) -> None:
        for process in (self.scheduler, *self.workers):
            process.kill()
            process.wait()

    def _start(self, *arguments: str, **settings: str) -> subprocess.Popen[bytes]:
        path = self._folder / f"{arguments[0]}-{len(self.workers)}"
        with path.open("wb") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments],
                cwd=self._folder,
                env={**self._environment, **settings},
                stdout=log,
                stderr=subprocess.STDOUT,
            )


def _is_whole(path: Path) -> bool:
    try:
        return bool(json.loads(path.read_text()))
    except (FileNotFoundError, json.JSONDecodeError):
        return False


@contextmanager
def dask_processes(folder: Path, workers: int, **settings: str) -> Iterator[DaskProcesses]:
    """A cluster with so many workers, perhaps still starting; ``settings`` of the environment."""
    cluster = DaskProcesses(folder, **settings)
    try:
        for _ in range(workers):
            cluster.start_worker()
        yield cluster
    finally:
        cluster.end()
