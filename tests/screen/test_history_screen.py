"""The runs of a real cell at the screen: gone back to, refused after an edit, compared, watched again."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual.pilot import Pilot

from hexacell.attach.snapshots import LiveSnapshot
from hexacell.cell.loader import Cell
from hexacell.controller_config.write_back import commit
from hexacell.screen.app import TechnicianApp
from hexacell.screen.cell_workplace import CellWorkplace
from hexacell.screen.overlays.confirm_overlay import ConfirmOverlay
from hexacell.screen.overlays.fault_overlay import FaultOverlay
from hexacell.screen.session import ScreenSession
from tests.hexacell.application.proposed_runs import ProposedRun, a_cell, propose_run
from tests.screen.conftest import settled
from tests.screen.test_job import press, shown, until_shown
from tests.waiting import until


class WithoutDevices(CellWorkplace):
    """The cell itself; its devices are not there."""

    async def watch(self) -> AsyncIterator[LiveSnapshot]:
        await asyncio.get_running_loop().create_future()
        yield  # type: ignore[misc]


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return a_cell(tmp_path)


@pytest.fixture
def runs(cell: Cell) -> list[ProposedRun]:
    """Two calibrations, one after the other."""
    written = []
    for name in ("2026-11-20T100000Z", "2026-11-21T100000Z"):
        run = propose_run(cell, name)
        commit(run.change, run.folder.path)
        written.append(run)
    return written


@asynccontextmanager
async def opened_history(cell: Cell) -> AsyncIterator[Pilot[int]]:
    app = TechnicianApp(lambda: ScreenSession(WithoutDevices(cell.path)))
    async with app.run_test(size=(100, 30)) as pilot:
        await until(lambda: app.backend is not None)
        await press(pilot, "5")
        await until(lambda: app.backend is not None and bool(app.backend.history().entries))
        await settled(pilot)
        yield pilot


async def test_the_config_of_before_the_latest_run_is_put_back(cell: Cell, runs: list[ProposedRun]) -> None:
    async with opened_history(cell) as pilot:
        await pilot.press("b")
        await until(lambda: isinstance(pilot.app.screen, ConfirmOverlay))
        assert "Undo 2026-11-21T100000Z" in shown(pilot)
        await press(pilot, "y")
        await until_shown(pilot, "again, bit for bit, which undoes the run 2026-11-21T100000Z")
    assert cell.config_path.read_bytes() == runs[1].before


async def test_an_earlier_config_is_gone_back_to(cell: Cell, runs: list[ProposedRun]) -> None:
    async with opened_history(cell) as pilot:
        await press(pilot, "down", "b")
        await until(lambda: isinstance(pilot.app.screen, ConfirmOverlay))
        assert "Go back to the controller's config that 2026-11-20T100000Z wrote?" in shown(pilot)
        await press(pilot, "y")
        await until_shown(pilot, "again, bit for bit")
    assert cell.config_path.read_bytes() == runs[0].after


async def test_nothing_is_put_back_without_a_yes(cell: Cell, runs: list[ProposedRun]) -> None:
    async with opened_history(cell) as pilot:
        await pilot.press("b")
        await until(lambda: isinstance(pilot.app.screen, ConfirmOverlay))
        await press(pilot, "n")
    assert cell.config_path.read_bytes() == runs[1].after


async def test_an_edited_config_is_kept_and_the_three_versions_are_shown(
    cell: Cell, runs: list[ProposedRun]
) -> None:
    edited = runs[1].after + b"# by hand\n"
    cell.config_path.write_bytes(edited)
    async with opened_history(cell) as pilot:
        await pilot.press("b")
        await until(lambda: isinstance(pilot.app.screen, ConfirmOverlay))
        await press(pilot, "y")
        await until(lambda: isinstance(pilot.app.screen, FaultOverlay))
        await press(pilot, "enter")
        await until_shown(pilot, "+# by hand")
    assert cell.config_path.read_bytes() == edited


async def test_what_cannot_be_compared_says_why(cell: Cell, runs: list[ProposedRun]) -> None:
    async with opened_history(cell) as pilot:
        await pilot.press("down", "v")
        await until(lambda: isinstance(pilot.app.screen, FaultOverlay))
        assert "no run before 2026-11-20T100000Z identified a geometry" in shown(pilot)


async def test_a_history_that_cannot_be_read_says_why_and_the_devices_stay(
    cell: Cell, runs: list[ProposedRun]
) -> None:
    cell.config_path.unlink()
    app = TechnicianApp(lambda: ScreenSession(WithoutDevices(cell.path)))
    async with app.run_test(size=(100, 30)) as pilot:
        await until(lambda: app.backend is not None)
        await press(pilot, "5")
        await until_shown(pilot, "cannot be read")
        assert not isinstance(app.screen, FaultOverlay)


async def test_the_drift_needs_three_calibrations(cell: Cell, runs: list[ProposedRun]) -> None:
    async with opened_history(cell) as pilot:
        await press(pilot, "o")
        await until_shown(pilot, "A drift needs three calibrations of the cell.")


async def test_a_recorded_run_is_watched_again_with_its_cursor(cell: Cell, runs: list[ProposedRun]) -> None:
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
