"""Poses are taken out of the plan at the screen, and the run begins without them."""

from __future__ import annotations

import asyncio

from textual.events import Key

from hexacell.campaign.removed_poses import NOTHING_REMOVED, RemovedPoses
from hexacell.cell.loader import Cell
from hexacell.screen.overlays.fault_overlay import FaultOverlay
from hexacell.screen.plan_screen import PlanScreen
from hexacell.screen.widgets.row_list import RowList
from hexacell.screen.workplace import TriedPlan
from hexacell.services.preflight.plan_draft import PlannedPose, PlanPreview
from tests.screen.conftest import Opened, settled
from tests.screen.test_job import press, shown, until_shown
from tests.screen.told_run import ToldRun, ToldWorkplace, snapshot
from tests.waiting import until


def tried(cell: Cell, error_mm: float = 0.075) -> TriedPlan:
    """A plan with three poses at each point."""
    poses = tuple(
        PlannedPose(point=point, orientation=row, pose=(*at, tilt, 4.0, -7.5))
        for point, at in enumerate(cell.settings.identification.points, start=1)
        for row, tilt in enumerate((0.0, 12.0, -25.0), start=1)
    )
    preview = PlanPreview(poses=poses, records=15, minutes=30.0, error_mm=error_mm, expanded_mm=0.15)
    return TriedPlan((f"15 records give {error_mm:.3f} mm.",), preview)


class SlowWorkplace(ToldWorkplace):
    """Its trials end when the test says so."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell, live=[snapshot()])
        self.trials: list[asyncio.Future[TriedPlan]] = []

    async def preview(self, removed: RemovedPoses) -> TriedPlan:
        self.removed.append(removed)
        self.trials.append(asyncio.get_running_loop().create_future())
        return await self.trials[-1]


async def test_what_is_taken_out_stays_out_of_the_run(cell: Cell, opened: Opened) -> None:
    run = ToldRun()
    run.begin(cell)
    workplace = ToldWorkplace(cell, live=[snapshot()], plan=tried(cell), started=run)
    async with opened(workplace) as pilot:
        await press(pilot, "2", "x")
        await until(lambda: bool(pilot.app.screen.query_one(RowList).option_count))
        workplace.plan = tried(cell, 0.09)
        await press(pilot, "down", "down", "x")
        await until_shown(pilot, "Left out: 1 pose. That costs 0.015 mm")
        await press(pilot, *["end"], "up", "up", "up", "delete")
        await until_shown(pilot, "Left out: 1 pose, point 5.")
        await press(pilot, "escape")
        await until_shown(pilot, "Left out: 1 pose, point 5. That costs 0.015 mm")
        await press(pilot, "s")
        await until(lambda: workplace.begun == ["optimise"])
        removed = workplace.removed[-1]
        assert removed.points == (5,)
        assert [(one.point, one.pose[3]) for one in removed.poses] == [(1, 12.0)]
        await until(lambda: pilot.app.current_mode == "measure")
        await press(pilot, "2")
        assert "Left out" not in shown(pilot), "the next run has everything again"


async def test_what_is_taken_out_is_put_back_with_the_same_key(cell: Cell, opened: Opened) -> None:
    workplace = ToldWorkplace(cell, live=[snapshot()], plan=tried(cell))
    async with opened(workplace) as pilot:
        await press(pilot, "2", "x", "x")
        await until_shown(pilot, "Left out: point 1.")
        await press(pilot, "x")
        await until(lambda: workplace.removed[-1] == NOTHING_REMOVED)
        await press(pilot, "down", "x")  # the reference of the first point
        await until(lambda: isinstance(pilot.app.screen, FaultOverlay))
        assert "1.1 is the reference of point 1" in shown(pilot)


async def test_the_latest_trial_counts_and_keys_are_heard_meanwhile(cell: Cell, opened: Opened) -> None:
    workplace = SlowWorkplace(cell)
    async with opened(workplace) as pilot:
        await press(pilot, "2", "v", "x")
        await until(lambda: len(workplace.trials) == 1)
        workplace.trials[0].set_result(tried(cell))
        await until(lambda: bool(pilot.app.screen.query_one(RowList).option_count))
        await press(pilot, "x")
        await until(lambda: len(workplace.trials) == 2)
        await press(pilot, "x")  # back in, before the trial without it has ended
        await until(lambda: len(workplace.trials) == 3)
        assert workplace.trials[1].cancelled()
        workplace.trials[2].set_result(tried(cell, 0.0761))
        await until(lambda: "Trying" not in shown(pilot))
        await settled(pilot)
        assert "Left out" not in shown(pilot)
        await press(pilot, "escape")
        await until_shown(pilot, "15 records give 0.076 mm.")


async def test_keys_that_are_typed_fast_are_taken_in_their_order(cell: Cell, opened: Opened) -> None:
    workplace = ToldWorkplace(cell, live=[snapshot()], plan=tried(cell))
    async with opened(workplace) as pilot:
        await press(pilot, "2", "x")
        await until(lambda: bool(pilot.app.screen.query_one(RowList).option_count))
        for key in ("down", "down", "enter"):
            pilot.app.post_message(Key(key, None))
        await until_shown(pilot, "Left out: 1 pose.")
        await until(lambda: [one.pose[3] for one in workplace.removed[-1].poses] == [12.0])


async def test_a_plan_that_cannot_be_tried_says_why(cell: Cell, opened: Opened) -> None:
    workplace = ToldWorkplace(cell, live=[snapshot()], plan=TriedPlan(("The config is not there.",)))
    async with opened(workplace) as pilot:
        await press(pilot, "2", "x")
        assert isinstance(pilot.app.screen, PlanScreen)
        await press(pilot, "x", "escape")
        await until_shown(pilot, "The config is not there.")
