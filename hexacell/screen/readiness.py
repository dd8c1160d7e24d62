"""What is known before a run: whether everything holds, and what the plan will give."""

import asyncio
from typing import Any

from hexacell.run_process.live_snapshot import LiveSnapshot
from hexacell.screen.child import TriedPlan
from hexacell.screen.device_watcher import DeviceWatcher
from hexacell.screen.preferences import ONCE
from hexacell.screen.workplace import Workplace
from hexacell.text.screens.checklist import (
    checked_items,
    live_items,
    plan_lines,
    plan_note,
    plan_rows,
    summary,
)
from hexacell.text.screens.views import ChecklistItem, Mark, Urgency
from procedures.calibration.calibration import Mode


class Readiness:
    """The checklist and the plan of a cell.

    Attributes:
        checked: what was looked at; None before.
        is_ready: whether everything held then.
        is_checking: whether it is being looked at.
    """

    def __init__(self, workplace: Workplace, devices: DeviceWatcher) -> None:
        self._workplace, self._devices = workplace, devices
        self.checked: tuple[ChecklistItem, ...] | None = None
        self.is_ready, self.is_checking = False, False
        self._is_unfolded = False
        self._tried: TriedPlan | None = None
        self._trial: asyncio.Future[TriedPlan] | None = None

    def checklist(self, live: LiveSnapshot | None) -> dict[str, tuple[Any, ...]]:
        """The parts of the checklist's screen."""
        items = self.items(live)
        lines = [(summary(items), Urgency.CALM)]
        lines += [line for item in items for line in item.lines(is_unfolded=self._is_unfolded)]
        said = self._tried.lines if self._tried else ()
        plan = plan_lines(self._workplace.cell.settings, said, is_trying=self._trial is not None)
        return {"checklist": (lines,), "plan": (plan,)}

    def items(self, live: LiveSnapshot | None) -> tuple[ChecklistItem, ...]:
        """All that must hold, first what does not."""
        if (checked := self.checked) is None:
            checked = checked_items(Mark.BUSY if self.is_checking else Mark.OPEN)
        every = (*live_items(live, is_checking=self.is_checking), *checked)
        return tuple(sorted(every, key=lambda one: one.mark is not Mark.FAILED))

    def poses(self) -> dict[str, tuple[Any, ...]]:
        """The parts of the plan's screen."""
        poses = self._tried.poses if self._tried else ()
        note = plan_note(poses, is_trying=self._trial is not None)
        return {"plan-note": (note,), "poses": ([*plan_rows(self._workplace.cell.settings, poses)],)}

    def unfold(self) -> None:
        """Show the identities of the devices, or no longer."""
        self._is_unfolded = not self._is_unfolded

    async def check(self, what: str) -> None:
        """Look at all that must hold before a mode; raises ``HexacellError``."""
        self.checked, self.is_ready, self.is_checking = None, False, True
        try:
            async with self._devices.released():
                preflight = await self._workplace.check(what or Mode.OPTIMISE)
            self.checked, self.is_ready = preflight.items, preflight.is_ready
        finally:
            self.is_checking = False

    async def preview(self, how_often: str = "") -> None:
        """Try the plan; an earlier trial is given up. Raises ``HexacellError``."""
        if how_often == ONCE and (self._trial is not None or self._tried is not None):
            return
        if self._trial is not None:
            self._trial.cancel()
        trial = self._trial = asyncio.ensure_future(self._workplace.preview())
        try:
            await asyncio.wait([trial])
            if trial is self._trial:
                self._trial = None
                self._tried = trial.result()
        finally:
            trial.cancel()

    async def toggle_exclusion(self, name: str) -> None:
        """Exclude a pose of the plan in the cell file, or no longer, and try the plan anew."""
        await self._workplace.toggle_exclusion(name, self._tried.poses if self._tried else ())
        await self.preview()
