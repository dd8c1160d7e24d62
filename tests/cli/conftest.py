"""The command line as it is used: typed in a folder, in a process of its own."""

import os
import pty
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from drivers.simulated.robot import SimulatedMachine
from hexacell.cell.loader import Cell, load_cell
from hexacell.cli.app import main
from hexacell.runs.archive import INDEX
from hexacell.services import search_effort
from procedures.journal.journal import read_journal
from procedures.steps import events
from tests.cli.cell_folder import PATIENT, QUICK, SHORT, CellFolder, copy_cell
from tests.cli.commands import Outcome, Start, run_command, started_in
from tests.cli.terminal import Terminal
from tests.made_once import made_once
from tests.small_cell import FEW_CHOICES


@pytest.fixture
def cell_folder(tmp_path: Path) -> CellFolder:
    """The cell of the demo, unchanged."""
    folder = tmp_path / "cell"
    folder.mkdir()
    return copy_cell(folder)


@pytest.fixture
def cell(cell_folder: CellFolder) -> Cell:
    """The same, loaded."""
    return load_cell(cell_folder.cell)


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
    monkeypatch.setattr(search_effort, "EFFORT", replace(search_effort.EFFORT, dry_run_robots=1))


@pytest.fixture
def few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Choose among few poses in this process, and check the plan on few; neither is under test."""
    monkeypatch.setattr(search_effort, "EFFORT", FEW_CHOICES)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a command; if it still runs after the test, it is killed."""
    with started_in(tmp_path) as starting:
        yield starting


@pytest.fixture(scope="module")
def served_cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The cell file that ``simulate`` prints of a short cell, which it serves in another process.

    No longer than one file needs it: waiting for clients takes a hundredth of a processor.
    """
    folder = tmp_path_factory.mktemp("served")
    cell = copy_cell(folder)
    cell.edit(*SHORT, *PATIENT)
    with started_in(folder) as start:
        process = start("simulate", cell.cell)
        process.wait_for("serving", lambda: process.err)
        served = folder / "served.toml"
        served.write_text(process.out)
        yield served


@pytest.fixture
def never_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails a test whose robot moves."""

    def move(_machine: SimulatedMachine, pose: object) -> None:
        pytest.fail(f"the robot was sent to {pose}")

    monkeypatch.setattr(SimulatedMachine, "move", move)


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
    """``hexacell demo --json``, once for all tests; do not change what is in its folder."""

    def ran_in(folder: Path) -> Demo:
        return Demo(run_command(folder, "demo", "--json"), folder / "hexacell-demo")

    return made_once(tmp_path_factory, "demo", ran_in)


@pytest.fixture
def calibrated(demo: Demo, tmp_path: Path) -> Path:
    """The cell file of a copy of the demo's cell with its run, and no index of it yet."""
    folder = tmp_path / "calibrated"
    shutil.copytree(demo.folder, folder, ignore=shutil.ignore_patterns(f"{INDEX}*"))
    return folder / demo.cell.name


@pytest.fixture
def run(demo: Demo, tmp_path: Path) -> Path:
    """A copy of the demo's run, to be written into."""
    copy = tmp_path / "2026-11-23T000000Z"
    shutil.copytree(demo.run, copy)
    return copy


@pytest.fixture
def lines_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands find a terminal that cannot move its cursor."""
    monkeypatch.setenv("TERM", "dumb")


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    """One to type at."""
    master, slave = pty.openpty()
    yield Terminal(master, slave)
    os.close(master)
    os.close(slave)
