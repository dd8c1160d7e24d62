"""The plan of a cell, tried on simulated robots behind the screen, and what a person takes out of it."""

from __future__ import annotations

import asyncio

from hexacell.campaign.removed_poses import NOTHING_REMOVED, RemovedPoses
from hexacell.errors import UsageError
from hexacell.screen.workplace import TriedPlan, Workplace
from hexacell.services.preflight.plan_draft import PlanDraft
from hexacell.text.plan_draft import removed_text
from hexacell.text.screens.live import TRYING


class PlanTrials:
    """Tries the plan again whenever something was taken out.

    Attributes:
        draft: its poses, and what of them is taken out; none before it was tried.
    """

    def __init__(self, workplace: Workplace) -> None:
        self.draft: PlanDraft | None = None
        self._workplace = workplace
        self._lines: tuple[str, ...] = ()
        self._trial: asyncio.Future[TriedPlan] | None = None

    @property
    def is_trying(self) -> bool:
        """Whether a trial goes on."""
        return self._trial is not None

    @property
    def removed(self) -> RemovedPoses:
        """What is taken out."""
        return NOTHING_REMOVED if self.draft is None else self.draft.removed

    @property
    def lines(self) -> tuple[str, ...]:
        """What the plan gives, and what it costs to take something out."""
        if self.is_trying:
            return (TRYING,)
        cost = "" if self.draft is None else removed_text(self.draft)
        return (cost, *self._lines) if cost else self._lines

    def forget(self) -> None:
        """Have the whole plan again, not tried yet."""
        self._end_trial()
        self.draft, self._lines = None, ()

    async def take_out(self, name: str) -> None:
        """Take a point or a pose out, or put it back, and try the plan so.

        Raises:
            UsageError: there is no such thing, or too little would be left.
        """
        if self.draft is None:
            raise UsageError("the plan was not tried yet", action="Press v in 2 Preflight")
        self.draft = self.draft.toggled(name)
        await self.try_again()

    async def try_again(self) -> None:
        """Try the plan; an earlier trial is given up. Raises ``HexacellError``."""
        self._end_trial()
        removed = self.removed
        trial = self._trial = asyncio.ensure_future(self._workplace.preview(removed))
        try:
            await asyncio.wait([trial])
            if trial is self._trial:
                self._trial = None
                self._keep(trial.result(), removed)
        finally:
            trial.cancel()

    def _end_trial(self) -> None:
        trial, self._trial = self._trial, None
        if trial is not None:
            trial.cancel()

    def _keep(self, tried: TriedPlan, removed: RemovedPoses) -> None:
        self._lines = tried.lines
        if tried.preview is not None:
            settings = self._workplace.cell.settings
            draft = self.draft or PlanDraft(settings, tried.preview, tried.preview)
            self.draft = draft.after(tried.preview, removed)
