"""The runs of a real cell at the screen: gone back to, refused after an edit, compared, watched again."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual.pilot import Pilot

from hexacell.cell.loader import Cell
from hexacell.config.versions import ConfigEditedSince
from hexacell.errors import FileError, UsageError
from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.screen.app import TechnicianApp
from hexacell.screen.model import ScreenModel
from hexacell.screen.overlays import ConfirmOverlay
from hexacell.screen.preferences import ScreenAction
from hexacell.screen.widgets import KeyLine
from hexacell.screen.workplace import Workplace
from hexacell.services.write_back.config_history import config_history
from hexacell.text.config_changes import RELOAD
from hexacell.text.history import NO_DRIFT, history_line
from hexacell.text.screens.questions import PERSON
from hexacell.verdict.acceptance_gates import AcceptanceGate
from tests.hexacell.services.proposed_runs import ProposedRun, a_cell, committed_runs, propose_run
from tests.mutations.journals import with_checksum
from tests.screen.conftest import attended, settled
from tests.screen.test_job import press, shown, until_noticed, until_shown
from tests.waiting import until

pytestmark = pytest.mark.usefixtures("records_agree")


class WithoutDevices(Workplace):
    """The cell itself; its devices are not there."""

    async def watch(self) -> AsyncIterator[LiveSnapshot]:
        await asyncio.get_running_loop().create_future()
        yield  # type: ignore[misc]


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return a_cell(tmp_path)


@pytest.fixture
def runs(cell: Cell) -> list[ProposedRun]:
    return committed_runs(cell, "2026-11-20T100000Z", "2026-11-21T100000Z")


@asynccontextmanager
async def opened_history(cell: Cell) -> AsyncIterator[Pilot[int]]:
    app = TechnicianApp(lambda: ScreenModel(WithoutDevices(cell)))
    async with app.run_test(size=(100, 30)) as pilot:
        await until(lambda: app.model is not None)
        await press(pilot, "5")
        await until(lambda: app.model is not None and bool(app.model.runs))
        await settled(pilot)
        yield pilot


async def test_what_is_not_done_says_why_and_changes_nothing(cell: Cell, runs: list[ProposedRun]) -> None:
    earlier, latest = (run.folder.path.name for run in runs)
    async with attended(WithoutDevices(cell)) as model:
        await until(lambda: bool(model.runs))
        with pytest.raises(UsageError, match=f"no run before {earlier} identified a geometry"):
            await model.perform(ScreenAction.COMPARE, earlier)
        with pytest.raises(UsageError, match="nothing has written no config"):
            await model.confirmation(ScreenAction.ROLL_BACK, "nothing")
        await model.perform(ScreenAction.DRIFT)
        assert model.shown("history")["comparison"][0][-1] == NO_DRIFT
        assert cell.config_path.read_bytes() == runs[1].after
        edited = runs[1].after + b"# by hand\n"
        cell.config_path.write_bytes(edited)
        with pytest.raises(ConfigEditedSince):
            await model.perform(ScreenAction.ROLL_BACK, latest)
        assert "+# by hand" in model.shown("history")["comparison"][0]
        assert cell.config_path.read_bytes() == edited


async def test_a_history_that_cannot_be_read_says_why(cell: Cell, runs: list[ProposedRun]) -> None:
    cell.config_path.unlink()
    async with attended(WithoutDevices(cell)) as model:
        await until(lambda: model.runs == ())
        assert "cannot be read" in model.shown("history")["comparison"][0][-1]


async def test_a_recorded_run_is_watched_again_with_its_cursor_and_undone(cell, runs) -> None:
    async with opened_history(cell) as pilot:
        await press(pilot, "enter")
        await until_shown(pilot, "recorded calibration 2026-11-21T100000Z")
        last = shown(pilot)
        await press(pilot, "home")
        await until_shown(pilot, " 1/")
        await press(pilot, "right")
        await until_shown(pilot, " 2/")
        await press(pilot, "left", "end")
        await until(lambda: shown(pilot) == last)
        await press(pilot, "space")  # from the end it is played from the beginning
        await until_shown(pilot, " x1")
        assert shown(pilot) != last
        await press(pilot, "space", "end")
        await until(lambda: shown(pilot) == last)
        await press(pilot, "5", "b")
        await until_asked(pilot)
        assert "Undo 2026-11-21T100000Z" in shown(pilot)
        await press(pilot, "n")
        assert cell.config_path.read_bytes() == runs[1].after
        await press(pilot, "b", "y")
        await until_shown(pilot, "again, bit for bit, which undoes the run 2026-11-21T100000Z")
        await until(lambda: [one.message for one in pilot.app._notifications] == [RELOAD])
    assert cell.config_path.read_bytes() == runs[1].before
    assert config_history(cell).writes[0].record.by == PERSON


async def test_a_click_on_a_key_does_what_the_key_does(cell: Cell, runs: list[ProposedRun]) -> None:
    async with opened_history(cell) as pilot:
        assert str(pilot.app.screen.query_one(KeyLine).content).startswith("Enter Show")
        await pilot.click(KeyLine, offset=(2, 0))
        await until_shown(pilot, "recorded calibration 2026-11-21T100000Z")


@pytest.fixture
def left(cell: Cell) -> ProposedRun:
    """A calibration that nobody was there to approve."""
    return propose_run(cell, "2026-11-22T100000Z", verdict=None)


def latest_line(pilot: Pilot[int]) -> str:
    app = pilot.app
    assert isinstance(app, TechnicianApp)
    assert app.model is not None
    assert app.model.runs
    return history_line(app.model.runs[0])


async def until_asked(pilot: Pilot[int]) -> None:
    await until(lambda: isinstance(pilot.app.screen, ConfirmOverlay))
    await settled(pilot)


async def test_an_open_proposal_is_written_once_it_is_approved(cell: Cell, left: ProposedRun) -> None:
    async with opened_history(cell) as pilot:
        assert latest_line(pilot).endswith("proposal")
        keys = pilot.app.screen.query_one(KeyLine)
        assert "w Write its proposal" in str(keys.content)
        await pilot.press("w")
        await until_asked(pilot)
        assert "No held-out record has verified it." in shown(pilot)
        assert cell.config_path.read_bytes() == left.before
        await press(pilot, "y")
        await until_shown(pilot, "approved by a person at the screen.")
        assert "Restart or reload the controller" in shown(pilot)
        await until(lambda: latest_line(pilot).endswith("in controller"))
        await until(lambda: "Write its proposal" not in str(keys.content))
        await press(pilot, "w")
        await until_noticed(pilot, "has no proposal that could be written")
    assert cell.config_path.read_bytes() == left.after


async def test_a_run_that_is_looked_at_again_is_approved_from_its_review(cell, left) -> None:
    async with opened_history(cell) as pilot:
        await press(pilot, "enter")
        await until_shown(pilot, "recorded calibration 2026-11-22T100000Z")
        await press(pilot, "4")
        await until_shown(pilot, "Its proposal can still be written: w asks for it")
        await press(pilot, "w")
        await until_asked(pilot)
        await press(pilot, "n")
        assert cell.config_path.read_bytes() == left.before
        await press(pilot, "w")
        await until_asked(pilot)
        await press(pilot, "y")
        await until(lambda: cell.config_path.read_bytes() == left.after)
        await until(lambda: latest_line(pilot).endswith("in controller"))
        await settled(pilot)
        assert "can still be written" not in shown(pilot)


async def test_what_a_gate_refuses_cannot_be_written(cell: Cell) -> None:
    gate = AcceptanceGate(name="converged", passed=False, sentence="The solver ended badly.")
    left = propose_run(cell, "2026-11-22T100000Z", gates=(gate,), verdict=None)
    async with opened_history(cell) as pilot:
        await pilot.press("w")
        await until_asked(pilot)
        assert "It cannot be approved. The solver ended badly." in shown(pilot)
        await press(pilot, "y")
        assert isinstance(pilot.app.screen, ConfirmOverlay)
        await press(pilot, "escape")
    assert cell.config_path.read_bytes() == left.before


async def test_a_forged_run_is_not_opened(cell: Cell, runs: list[ProposedRun]) -> None:
    """Its checksums are right, and its geometry is that of no robot."""
    journal = runs[1].folder.journal
    first, *others = journal.read_bytes().splitlines(keepends=True)
    record = json.loads(first)
    record["event"]["controller"]["B"] = [[1.0], [2.0, 3.0]]
    del record["crc"]
    journal.write_bytes(with_checksum(record) + b"".join(others))
    with pytest.raises(FileError, match="a geometry has other parameters"):
        await Workplace(cell).open_run(runs[1].folder.path.name)
    await Workplace(cell).open_run(runs[0].folder.path.name)
