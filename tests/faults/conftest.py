"""The program in processes of its own that can be broken anywhere, and what it promises then."""

import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from hexacell.config.change import AFTER
from hexacell.runs.run_folder import RunFolder
from procedures.journal.journal import read_journal
from procedures.resources.controller_config import PROVISIONAL_FOLDER
from procedures.steps import events
from tests.faults.cell import MEASURED, NEVER_GOOD_ENOUGH, PROVISIONAL, Site, make_site
from tests.faults.driver import UNEXPECTED, Order
from tests.faults.interception import Call
from tests.made_once import made_once
from tests.signals import terminal_signals

ROOT = Path(__file__).parents[2]
MEMORY = Path("/dev/shm")
"""A file system that needs no disk: what is tested here is what is called, not how long it takes."""


@dataclass(frozen=True)
class Ended:
    """How a process ended: its exit code, or its signal, negative; after how long; what it said and did."""

    code: int
    words: str
    seconds: float
    calls: tuple[Call, ...] = ()


class Program:
    """Starts the program in processes of its own, one after the other; ``folder`` is for its words."""

    def __init__(self, server: subprocess.Popen[str], folder: Path) -> None:
        self._server = server
        self._output = folder / "output"
        assert server.stdout is not None
        assert server.stdout.readline() == "ready\n"

    def __call__(self, order: Order) -> Ended:
        """Carry out one order; a traceback is never an answer."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(order.to_json() + "\n")
        self._server.stdin.flush()
        begun = time.monotonic()
        code = int(self._server.stdout.readline())
        seconds = time.monotonic() - begun
        words = Path(order.output).read_text()
        assert code != UNEXPECTED, words
        assert "Traceback" not in words, words
        told = Path(order.output + ".calls")
        calls = pickle.loads(told.read_bytes()) if told.exists() else []
        told.unlink(missing_ok=True)
        return Ended(code, words, seconds, tuple(calls))

    def run(self, site: Site, *arguments: object, **breaking: Any) -> Ended:
        """``hexacell run`` on the site's cell, with nobody at the terminal."""
        words = tuple(str(argument) for argument in ("run", site.cell_path, *arguments))
        return self(Order(words, str(site.folder), str(self._output), **breaking))

    def resume(self, site: Site, run: RunFolder | None = None, **breaking: Any) -> Ended:
        """``hexacell run --resume`` of the site's only run, or of this one."""
        return self.run(site, "--resume", (run or site.run()).path, **breaking)


@pytest.fixture(scope="session")
def program(session_ground: Path) -> Iterator[Program]:
    with terminal_signals():
        starting = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.driver"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
    with starting as server:
        session_ground.chmod(0o777)
        yield Program(server, session_ground)
        assert server.stdin is not None
        server.stdin.close()


@pytest.fixture
def ground() -> Iterator[Path]:
    """A folder for this test, in memory where there is such a place."""
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        yield Path(folder)


@pytest.fixture(scope="session")
def session_ground() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        yield Path(folder)


@pytest.fixture
def new_site(ground: Path) -> Callable[..., Site]:
    """A fresh cell; those of former calls are removed."""

    def make(*changes: dict[str, Any], **patience: float) -> Site:
        shutil.rmtree(ground / "cell", ignore_errors=True)
        return make_site(ground / "cell", *changes, **patience)

    return make


@dataclass(frozen=True)
class Whole:
    """A run that nothing disturbed, with what was changed for it, and everything that it left."""

    site: Site
    changes: tuple[dict[str, Any], ...]
    ended: Ended
    history: tuple[events.Event, ...]
    config_before: bytes

    @property
    def config_after(self) -> bytes:
        """The config that was written, whether or not it was rolled back."""
        return (self.folder.path / AFTER).read_bytes()

    def name_of(self, config: bytes) -> str:
        """Which of the run's configs this is; it is always one of them, whole."""
        names = {self.config_before: "old", self.config_after: "new", self.config_lent: "lent"}
        assert config in names
        return names[config]

    @property
    def config_lent(self) -> bytes | None:
        """The config that was lent meanwhile, if one was."""
        kept = self.folder.path / PROVISIONAL_FOLDER / AFTER
        return kept.read_bytes() if kept.exists() else None

    @property
    def folder(self) -> RunFolder:
        return self.site.run()


def whole(program: Program, folder: Path, *changes: dict[str, Any], code: int = 0) -> Whole:
    site = make_site(folder / "cell", *changes)
    before = site.config.read_bytes()
    ended = program.run(site, failing={})
    assert ended.code == code, ended.words
    return Whole(site, changes, ended, read_journal(site.run().journal), before)


@pytest.fixture(scope="session")
def undisturbed(program: Program, tmp_path_factory: pytest.TempPathFactory) -> Whole:
    """A run that passes."""
    return made_once(tmp_path_factory, "undisturbed", lambda folder: whole(program, folder))


@pytest.fixture(scope="session")
def rolled_back(program: Program, session_ground: Path) -> Whole:
    """A run whose result is not good enough and is taken back."""
    found = whole(program, session_ground / "rolled back", NEVER_GOOD_ENOUGH, code=1)
    assert found.site.config.read_bytes() == found.config_before
    return found


@pytest.fixture(scope="session")
def lent(program: Program, session_ground: Path) -> Whole:
    """A run whose controller is lent a geometry meanwhile."""
    return whole(program, session_ground / "lent", PROVISIONAL)


@pytest.fixture(scope="session")
def noise_measured(program: Program, tmp_path_factory: pytest.TempPathFactory) -> Whole:
    """A run that measures the noise at its first reference."""
    return made_once(tmp_path_factory, "noise", lambda folder: whole(program, folder, MEASURED))


@pytest.fixture
def whole_with(request: pytest.FixtureRequest) -> Callable[[str], Whole]:
    """The undisturbed run to compare with where a kind of step is broken: not every run has each."""
    others = {
        "rolling back": "rolled_back",
        "lending": "lent",
        "taking back": "lent",
        "measuring noise": "noise_measured",
    }

    def find(step: str) -> Whole:
        found: Whole = request.getfixturevalue(others.get(step, "undisturbed"))
        return found

    return find
