"""The planned poses at the screen: a key writes an exclusion into the cell file, or removes it."""

import asyncio
import shutil
from pathlib import Path

import pytest
from textual.events import Key
from textual.pilot import Pilot

from hexacell.cell.loader import Cell, load_cell
from hexacell.dry_run.campaign import VisitedPose
from hexacell.errors import UsageError
from hexacell.kinematics.pose import Pose
from hexacell.screen.child import TriedPlan
from hexacell.screen.preferences import ONCE, ScreenAction
from hexacell.screen.widgets import RowList
from hexacell.services.preflight import toggle_exclusion
from tests.screen.conftest import attended
from tests.screen.test_job import press, shown, until_noticed, until_shown
from tests.screen.told_run import ToldRun, ToldWorkplace, snapshot
from tests.waiting import until


def tried(cell: Cell, error_mm: float = 0.075) -> TriedPlan:
    """A plan with three poses at each point."""
    poses = tuple(
        (point, row, Pose(*at, tilt, *((4.0, -7.5) if tilt else ())))
        for point, at in enumerate(cell.settings.identification.points, start=1)
        for row, tilt in enumerate((0.0, 12.0, -25.0), start=1)
    )
    return TriedPlan(lines=(f"15 records give {error_mm:.3f} mm.",), poses=poses)


class FileWorkplace(ToldWorkplace):
    """Its cell file is written; with ``is_slow`` a trial ends when the test says so."""

    def __init__(self, cell: Cell, folder: Path, *, is_slow: bool = False) -> None:
        for path in (cell.path, *cell.config_paths):
            shutil.copy(path, folder)
        super().__init__(load_cell(folder / cell.path.name), live=[snapshot()], plan=tried(cell))
        self.trials: list[asyncio.Future[TriedPlan]] = []
        self._is_slow = is_slow

    async def preview(self) -> TriedPlan:
        if not self._is_slow:
            return await super().preview()
        self.trials.append(asyncio.get_running_loop().create_future())
        return await self.trials[-1]

    async def toggle_exclusion(self, name: str, planned: tuple[VisitedPose, ...]) -> None:
        self.cell = toggle_exclusion(self.cell, name, planned)


def rows(pilot: Pilot[int]) -> list[str]:
    """The lines of the list of planned poses."""
    return [str(one.prompt) for one in pilot.app.screen.query_one(RowList).options]


async def test_a_key_excludes_in_the_cell_file_and_the_plan_is_tried_anew(cell, opened, tmp_path) -> None:
    workplace = FileWorkplace(cell, tmp_path)
    before = workplace.cell.path.read_text()
    async with opened(workplace) as pilot:
        await press(pilot, "2", "x")
        await until(lambda: bool(pilot.app.screen.query_one(RowList).option_count))
        await press(pilot, "down", "down", "x")  # the second pose of the first point
        await until(lambda: rows(pilot)[0].endswith("within 30 mm, 5 deg"))
        await until(lambda: workplace.tried == 2)
        [refused] = load_cell(workplace.cell.path).settings.excluded_commands.commands
        assert refused.pose[3] == 12.0
        await press(pilot, "home", "x")
        await until(lambda: workplace.cell.path.read_text() == before)
        await press(pilot, "home", "x")
        await until(lambda: rows(pilot)[0].startswith("OUT  e1  point 1"))
        await press(pilot, "home", "x")
        await until(lambda: "OUT" not in rows(pilot)[0])
        await press(pilot, "home", "down", "x")  # the reference of the first point
        await until_noticed(pilot, "1.1 is the reference of its point")
        assert workplace.cell.path.read_text() == before


async def test_nothing_is_excluded_while_a_run_goes_on(cell: Cell, tmp_path: Path) -> None:
    workplace, run = FileWorkplace(cell, tmp_path), ToldRun()
    run.begin(workplace.cell)
    workplace.run = run
    async with attended(workplace) as model:
        await until(lambda: model.may_leave_run)
        with pytest.raises(UsageError, match="exclude has no effect now"):
            await model.perform(ScreenAction.EXCLUDE, "1")
        assert not workplace.cell.settings.exclusions


async def test_the_latest_trial_counts_and_keys_are_heard_meanwhile(cell, opened, tmp_path) -> None:
    workplace = FileWorkplace(cell, tmp_path, is_slow=True)
    async with opened(workplace) as pilot:
        await press(pilot, "2", "v", "x")
        await until(lambda: len(workplace.trials) == 1)
        workplace.trials[0].set_result(tried(cell))
        await until(lambda: bool(pilot.app.screen.query_one(RowList).option_count))
        for key in ("down", "down", "enter"):  # typed fast
            pilot.app.post_message(Key(key, None))
        await until(lambda: len(workplace.trials) == 2)
        await press(pilot, "v")
        await until(lambda: len(workplace.trials) == 3)
        assert workplace.trials[1].cancelled()
        workplace.trials[2].set_result(tried(cell, 0.0761))
        await until(lambda: "Trying" not in shown(pilot))
        await press(pilot, "escape")
        await until_shown(pilot, "15 records give 0.076 mm.")


async def test_a_plan_that_cannot_be_tried_says_why(cell: Cell) -> None:
    plan = TriedPlan(lines=("The config is not there.",))
    async with attended(ToldWorkplace(cell, live=[snapshot()], plan=plan)) as model:
        await model.perform(ScreenAction.PREVIEW, ONCE)
        assert model.shown("preflight")["plan"] == (["The config is not there."],)
        assert list(model.shown("plan")["poses"][0]) == []
