"""The command line as it is used: typed in a folder, in a process of its own."""

from __future__ import annotations

import fcntl
import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hexacell.campaign.dry_run import dry_run
from hexacell.cli.app import main
from procedures.journal.journal import Journal, read_journal
from procedures.run import events
from tests.signals import terminal_signals
from tests.waiting import wait_until

CONFIGS = Path(__file__).parents[2] / "configs"
CELL = "simulated-hexaglide.toml"
CONTROLLER = "simulated-hexaglide.controller.toml"

# Fewer records and wide limits, on a cell that lives fast: the whole job in a few seconds.
QUICK = (
    ("clock_factor = 150.0", "clock_factor = 600.0"),
    ("give_up_s = 60.0", "give_up_s = 6000.0"),
    ("orientations = 11", "orientations = 7"),
    ("orientations = 6", "orientations = 2"),
    ("position_mm = 0.25 ", "position_mm = 20.0"),
    ("orientation_deg = 0.08", "orientation_deg = 5.0"),
    # Large rotations: few records identify it.
    ("turn_deg = 60.0", "turn_deg = 180.0"),
    ("leg_distance_mm = 30.0", "leg_distance_mm = 0.0"),
    ("base_cone_deg = 45.0", "base_cone_deg = 180.0"),
    ("platform_cone_deg = 45.0", "platform_cone_deg = 180.0"),
    ("[stations]\n", "[stations]\ntrial_mm = 0.0\n"),
    ("provisional = true", "provisional = false"),
    # Each test of the model fails one healthy run in a thousand, and the suite has hundreds of runs.
    ("encoder_mm = 0.01\ngauge_mm = 0.01", "encoder_mm = 0.014\ngauge_mm = 0.014"),
)

# A busy machine may leave a simulated device waiting longer than a real one ever takes.
PATIENT = (
    *(
        (f"{place}\ntimeout_s = 3.0", f"{place}\ntimeout_s = 20.0")
        for place in (
            "omit it if its display does not tell",
            "the multiplexer's input\nmiddle_mm = 0.0",
            "Starrett with RS-232\nmiddle_mm = 0.0",
            "the paper's encoders had about 2.4",
        )
    ),
    ("heartbeat_ms = 3000", "heartbeat_ms = 5000"),
)

# As few records as identify it.
SHORT = (
    (
        """points = [
  [0.0, 0.0, 550.0],
  [0.0, -200.0, 550.0],
  [100.0, -100.0, 500.0],
  [100.0, 0.0, 600.0],
  [-100.0, 100.0, 500.0],
]
orientations = 11""",
        """points = [
  [100.0, -100.0, 500.0],
  [-100.0, 100.0, 500.0],
]
orientations = 7""",
    ),
)

Edits = tuple[tuple[str, str], ...]


def changed(text: str, edits: Edits) -> str:
    """``text`` with each edit made, at the one place where it can be."""
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


@dataclass(frozen=True)
class Outcome:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """The one JSON document that is all of stdout."""
        assert self.out.endswith("\n")
        return json.loads(self.out)


@dataclass
class CellFolder:
    """A folder with a cell in it, its controller's config, and nothing else."""

    path: Path

    @property
    def cell(self) -> Path:
        return self.path / CELL

    @property
    def controller(self) -> Path:
        return self.path / CONTROLLER

    def edit(self, *edits: tuple[str, str]) -> None:
        self.cell.write_text(changed(self.cell.read_text(), edits))

    def wait_long_for_devices(self) -> None:
        """Let a busy machine take its time."""
        self.edit(*PATIENT)

    def snapshot(self) -> dict[str, bytes | None]:
        """Everything in it except the lock, whose content has no meaning."""
        return {
            str(path.relative_to(self.path)): path.read_bytes() if path.is_file() else None
            for path in self.path.rglob("*")
            if not path.name.endswith(".hexacell-lock")
        }

    def runs(self) -> list[Path]:
        return sorted((self.path / "runs" / "simulated-hexaglide").glob("*"))

    def rewound(self, run: Path, before: str) -> Path:
        """A run of this cell that got as far as ``run`` before a step."""
        history = read_journal(run / "journal.jsonl")
        steps = [event.step.key if isinstance(event, events.StepBegun) else "" for event in history]
        started = history[0].model_copy(update={"cell_text": self.cell.read_text()})
        journal = self.path / "runs" / "simulated-hexaglide" / "rewound" / "journal.jsonl"
        journal.parent.mkdir(parents=True)
        with Journal(journal) as new:
            new.append(started)
        lines = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
        with journal.open("ab") as stream:
            stream.writelines(lines[1 : steps.index(before)])
        for event in history[: steps.index(before)]:
            if isinstance(event, events.ProvisionalApplied):
                self._copy_write_back(run / event.folder, journal.parent / event.folder)
        return journal.parent

    def _copy_write_back(self, folder: Path, copy: Path) -> None:
        """A write to another cell's config as one to this cell's."""
        shutil.copytree(folder, copy)
        note = copy / "write-back.json"
        noted = {"path": str(self.controller), "backup_folder": str(copy)}
        note.write_text(json.dumps(json.loads(note.read_bytes()) | noted))


def copy_cell(folder: Path) -> CellFolder:
    for name in (CELL, CONTROLLER):
        (folder / name).write_bytes((CONFIGS / name).read_bytes())
    return CellFolder(folder)


@pytest.fixture
def cell_folder(tmp_path: Path) -> CellFolder:
    """The cell of the demo, unchanged."""
    folder = tmp_path / "cell"
    folder.mkdir()
    return copy_cell(folder)


@pytest.fixture
def quick_cell(cell_folder: CellFolder) -> CellFolder:
    """The same, calibrated in a few seconds."""
    cell_folder.edit(*QUICK)
    cell_folder.wait_long_for_devices()
    return cell_folder


@pytest.fixture
def short_cell(cell_folder: CellFolder) -> CellFolder:
    """The same with two points and seven orientations at each."""
    cell_folder.edit(*SHORT)
    return cell_folder


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "hexacell", *map(str, arguments)]


def surroundings(temporary: Path) -> dict[str, str]:
    """An environment with a folder of its own for temporary files, and help of the usual width."""
    temporary.mkdir()
    return {**os.environ, "COLUMNS": "80", "TMPDIR": str(temporary)}


def run_command(folder: Path, *arguments: object) -> Outcome:
    """Run a command in ``folder`` without a terminal, and wait until it ends."""
    temporary = folder / f"temporary-{secrets.token_hex(4)}"
    with terminal_signals():
        ended = subprocess.run(
            command(*arguments),
            cwd=folder,
            env=surroundings(temporary),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
    assert "Traceback" not in ended.stderr, ended.stderr
    temporary.rmdir()  # which fails where something was left in it
    return Outcome(ended.returncode, ended.stdout, ended.stderr)


Typed = Callable[..., Outcome]


@pytest.fixture
def typed(tmp_path: Path) -> Typed:
    """Runs a command in a process of its own, in the test's folder."""
    return lambda *arguments: run_command(tmp_path, *arguments)


@pytest.fixture
def typed_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Typed:
    """The same within this process, if starting one would take longer than the command."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> Outcome:
        code = main([str(argument) for argument in arguments])
        return Outcome(code, *capsys.readouterr())

    return run


@pytest.fixture
def one_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Predict on a single robot and from few poses: the output is under test, not its quality."""
    monkeypatch.setattr("hexacell.application.offline.dry_run", partial(dry_run, robots=1))


@pytest.fixture
def few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Choose among few poses in this process, and check the plan on few; neither is under test."""
    monkeypatch.setattr("hexacell.campaign.feasibility.CANDIDATES", 8)
    monkeypatch.setattr("hexacell.campaign.feasibility.ROBOTS", 4)
    monkeypatch.setattr("procedures.calibration.workflow.CANDIDATES", 64)
    monkeypatch.setattr("procedures.calibration.measuring.HELD_OUT_CANDIDATES", 128)


@dataclass
class Process:
    """A running command; its output goes to files."""

    popen: subprocess.Popen[str]
    out_path: Path
    err_path: Path
    temporary: Path

    @property
    def out(self) -> str:
        return self.out_path.read_text()

    @property
    def err(self) -> str:
        return self.err_path.read_text()

    def wait_for(self, words: str, where: Callable[[], str]) -> None:
        """Wait until it has printed some text."""
        self.wait_until(lambda: words in where(), words)

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        wait_until(lambda: condition() or self.popen.poll() is not None)
        if not condition():
            pytest.fail(f"waiting for {what!r}: {self.popen.poll()}\n{self.out}\n{self.err}")

    def ended(self) -> Outcome:
        """How it ends by itself; it leaves no temporary files."""
        code = self.popen.wait()
        assert "Traceback" not in self.err, self.err
        assert list(self.temporary.iterdir()) == []
        return Outcome(code, self.out, self.err)

    def stopped(self, number: signal.Signals) -> Outcome:
        """How it ends on a signal."""
        self.popen.send_signal(number)
        return self.ended()


Start = Callable[..., Process]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a command; if it still runs after the test, it is killed."""
    with started_in(tmp_path) as starting:
        yield starting


@pytest.fixture(scope="session")
def processes() -> Callable[[Path], AbstractContextManager[Start]]:
    """The same for any folder and scope; the folder gets a fresh short cell."""

    def with_cell(folder: Path) -> AbstractContextManager[Start]:
        copy_cell(folder).edit(*SHORT)
        return started_in(folder)

    return with_cell


@contextmanager
def started_in(folder: Path) -> Iterator[Start]:
    with_folder = Processes(folder)
    try:
        yield with_folder.start
    finally:
        with_folder.end()


class Processes:
    """Running commands in one folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._processes: list[Process] = []

    def start(self, *arguments: object, through: str | None = None, **streams: int) -> Process:
        """Start a command, ``through`` a shell's script if there is one."""
        out, err, temporary = (
            self._folder / f"{name}-{len(self._processes)}" for name in ("out", "err", "temporary")
        )
        with out.open("w") as to_out, err.open("w") as to_err, terminal_signals():
            popen = subprocess.Popen(
                [*(["sh", "-c", through, "sh"] if through else []), *command(*arguments)],
                cwd=self._folder,
                env=surroundings(temporary),
                stdin=streams.get("stdin", subprocess.DEVNULL),
                stdout=streams.get("stdout", to_out),
                stderr=streams.get("stderr", to_err),
                text=True,
            )
        process = Process(popen, out, err, temporary)
        self._processes.append(process)
        return process

    def end(self) -> None:
        for process in self._processes:
            process.popen.kill()
            process.popen.wait()


@dataclass(frozen=True)
class Demo:
    """The demo after it ran, and how it ended."""

    outcome: Outcome
    folder: Path
    name: str = "simulated-hexaglide"

    @property
    def run(self) -> Path:
        return self.folder / "runs" / self.name / "demo"

    @property
    def cell(self) -> Path:
        return self.folder / f"{self.name}.toml"

    @property
    def controller(self) -> Path:
        return self.folder / f"{self.name}.controller.toml"

    def events(self) -> tuple[events.Event, ...]:
        return read_journal(self.run / "journal.jsonl")


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    """``hexacell demo --json``, once for all tests; do not change what is in its folder.

    Of several processes that run tests the first one that needs it makes it, and the others wait.
    """
    together = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        together = together.parent
    folder, kept = together / "demo", together / "demo.json"
    with (together / "demo.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            folder.mkdir()
            kept.write_text(json.dumps(asdict(run_command(folder, "demo", "--json"))))
    return Demo(Outcome(**json.loads(kept.read_text())), folder / "hexacell-demo")
