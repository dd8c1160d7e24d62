"""At a plain terminal: the poses of the plan, each of which may be taken out before the run begins."""

from __future__ import annotations

import sys

from hexacell.campaign.removed_poses import RemovedPoses
from hexacell.cell.loader import Cell
from hexacell.cli.console import Console
from hexacell.errors import AnswerNeeded, UsageError
from hexacell.services.preflight.plan_draft import PlanDraft, preview_of, try_mode
from hexacell.text.layout import wrapped
from hexacell.text.plan_draft import REQUEST, mode_trial_lines, plan_rows, removed_text
from hexacell.text.planning import TRYING_PLAN
from procedures.calibration.workflow import Mode


class PlanDialog:
    """Asks until the person is content with what a run of some mode would measure on a cell."""

    def __init__(self, cell: Cell, mode: Mode, console: Console) -> None:
        self._cell, self._mode, self._console = cell, mode, console

    def choose(self) -> RemovedPoses:
        """What is taken out.

        Raises:
            AnswerNeeded: the terminal's input has ended, or the person wants no run.
            UsageError: no simulated robot could be calibrated with the whole plan.
        """
        draft = self._tried(None)
        self._list(draft)
        while typed := self._typed():
            if typed == ["l"]:
                self._list(draft)
            elif (changed := self._changed(draft, typed)) is not None:
                draft = self._tried(changed)
        return draft.removed

    def _typed(self) -> list[str]:
        """The words of a line; none where the run is to begin."""
        self._console.prompt(REQUEST)
        line = sys.stdin.readline()
        if not line or line.strip() == "q":
            raise AnswerNeeded("no run was begun", action="Begin one with `hexacell run`")
        return line.split()

    def _changed(self, draft: PlanDraft, names: list[str]) -> PlanDraft | None:
        """The draft with what was named taken out or put back; none where that cannot be."""
        try:
            for name in names:
                draft = draft.toggled(name)
        except UsageError as error:
            self._console.print(wrapped(str(error)))
            return None
        return draft

    def _tried(self, draft: PlanDraft | None) -> PlanDraft:
        """The draft once its plan was tried; without one, that of the whole plan."""
        self._console.print(TRYING_PLAN)
        removed = RemovedPoses() if draft is None else draft.removed
        trial = try_mode(self._cell, self._mode, removed)
        preview = preview_of(trial)
        if draft is None and not preview.poses:
            raise UsageError(
                "no simulated robot could be calibrated with this plan", subject=self._cell.path
            )
        whole = draft or PlanDraft(self._cell.settings, preview, preview)
        after = whole.after(preview, removed) if preview.poses else whole
        for line in filter(None, (*mode_trial_lines(trial), removed_text(after))):
            self._console.print(wrapped(line))
        return after

    def _list(self, draft: PlanDraft) -> None:
        for _, line in plan_rows(draft):
            self._console.print(line)
