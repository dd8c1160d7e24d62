"""Small cells that are calibrated for real: simulated devices, real drivers, real files."""

import asyncio
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from drivers.simulated.cell import SimulatedCell
from hexacell.cell.loader import Cell, load_cell
from hexacell.runs.run_folder import RunFolder, runs_folder
from hexacell.services.run.calibration_run import RunRequest, calibrate
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.engine.engine import Listener
from procedures.journal.journal import Journal, read_journal
from procedures.run.questions import Question
from procedures.steps import events
from tests.hexacell.services.proposed_runs import a_cell
from tests.made_once import made_once
from tests.small_cell import SMALL, few_candidates, history_until, write_small_cell

SERVED: dict[str, Any] = {
    "identification.orientations": 12,
    "timing.clock_factor": 500.0,
    "speed.joint": 1000.0,
    "speed.edge_mm_s": 1000.0,
    "speed.joint_at_gauges": 1000.0,
    "speed.edge_at_gauges_mm_s": 1000.0,
    "encoders.timeout_s": 10.0,
    "encoders.heartbeat_ms": 10_000,
    "simulation.motion.ringing_mm": 0.05,
}
"""Real drivers are patient with simulated devices on a fast clock.

Their noise depends on how many readings a machine takes, so that no run repeats another: there are more
poses than the fewest, from which one in twenty is identified too badly to end.
"""


MakeCell = Callable[..., Cell]


def maker(folder: Path) -> MakeCell:
    def make(**changes: Any) -> Cell:
        dotted = {key.replace("__", "."): value for key, value in changes.items()}
        return write_small_cell(folder, SMALL | SERVED | dotted, timeout_s=10.0)

    return make


@pytest.fixture
def make_cell(tmp_path: Path) -> MakeCell:
    return maker(tmp_path)


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    """The bundled cell in a folder of its own, for tests that measure nothing."""
    return a_cell(tmp_path)


@pytest.fixture(autouse=True)
def quick_choices() -> Iterator[None]:
    with few_candidates():
        yield


@dataclass(frozen=True)
class Finished:
    """A calibration from beginning to end, and what was there before."""

    cell: Cell
    folder: RunFolder
    ended: events.Ended
    told: tuple[events.Event, ...]
    config_before: bytes

    def order(self, **changes: Any) -> RunRequest:
        return order_of(self.cell, self.folder, **changes)

    @property
    def history(self) -> tuple[events.Event, ...]:
        return read_journal(self.folder.journal)

    def until(self, *kinds: type[Any], count: int = 1) -> tuple[events.Event, ...]:
        """The history up to and with the ``count``-th event of these kinds."""
        return history_until(self.history, *kinds, count=count)


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    path, run, ended, told, before = made_once(tmp_path_factory, "finished", finished_in)
    return Finished(load_cell(path), run, ended, told, before)


def finished_in(folder: Path) -> tuple[Path, RunFolder, events.Ended, tuple[events.Event, ...], bytes]:
    """The path of the cell and the rest of :class:`Finished`."""
    cell = maker(folder)()
    before = cell.config_path.read_bytes()
    run = RunFolder(runs_folder(cell) / "run")
    told: list[events.Event] = []
    with few_candidates():
        ended = asyncio.run(calibrate(order_of(cell, run), [lambda event, _: told.append(event)]))
    return cell.path, run, ended, tuple(told), before


def order_of(cell: Cell, folder: RunFolder, /, **changes: Any) -> RunRequest:
    order = RunRequest(cell, folder, Mode.OPTIMISE, UnattendedOperator(), unattended=True)
    return replace(order, **changes)


@dataclass
class Site:
    """A cell whose devices are served by the test, so that it may see and harm them."""

    cell: Cell
    folder: RunFolder
    simulated: SimulatedCell

    @property
    def config(self) -> bytes:
        return self.cell.config_path.read_bytes()

    def order(self, **changes: Any) -> RunRequest:
        cell = replace(self.cell, settings=self.simulated.settings)
        return order_of(cell, self.folder, **changes)

    async def calibrate(self, *listeners: Listener, **changes: Any) -> events.Ended:
        return await calibrate(self.order(**changes), listeners)

    def happened(self, kind: type[Any]) -> list[Any]:
        return [event for event in read_journal(self.folder.journal) if isinstance(event, kind)]

    def write(self, history: Sequence[events.Event], moved_from: Finished) -> None:
        """A run folder in which all this has happened already, somewhere else: it names what is there."""
        self.folder.create(self.cell)
        with Journal(self.folder.journal) as journal:
            for event in history:
                if isinstance(event, events.RunStarted):
                    event = event.model_copy(update={"cell_text": self.cell.text})  # noqa: PLW2901
                journal.append(event)
        shutil.copy(moved_from.folder.proposal, self.folder.proposal)


@pytest.fixture
def make_site(make_cell: MakeCell, tmp_path: Path) -> Iterator[Callable[..., Site]]:
    served: list[SimulatedCell] = []

    def make(**changes: Any) -> Site:
        cell = make_cell(**changes)
        assert cell.settings.simulation is not None
        simulated = SimulatedCell(cell.settings, cell.config_paths)
        served.append(simulated)
        return Site(cell, RunFolder(tmp_path / "run"), simulated)

    yield make
    for simulated in served:
        simulated.close()


class Approver:
    """A person who lets everything happen."""

    async def ask(self, question: Question) -> str | None:
        return question.default or (question.choices or ("a tester",))[-1]
