"""The plan of a cell, tried on simulated robots behind the screen."""

from __future__ import annotations

import asyncio

from hexacell.screen.workplace import TriedPlan, Workplace
from hexacell.text.screens.live import TRYING


class PlanTrials:
    """The latest trial of the plan.

    Attributes:
        tried: what came of it; None before the plan was tried.
    """

    def __init__(self, workplace: Workplace) -> None:
        self.tried: TriedPlan | None = None
        self._workplace = workplace
        self._trial: asyncio.Future[TriedPlan] | None = None

    @property
    def is_trying(self) -> bool:
        """Whether a trial goes on."""
        return self._trial is not None

    @property
    def lines(self) -> tuple[str, ...]:
        """What the plan gives."""
        return (TRYING,) if self.is_trying else () if self.tried is None else self.tried.lines

    async def try_again(self) -> None:
        """Try the plan; an earlier trial is given up. Raises ``HexacellError``."""
        if self._trial is not None:
            self._trial.cancel()
        trial = self._trial = asyncio.ensure_future(self._workplace.preview())
        try:
            await asyncio.wait([trial])
            if trial is self._trial:
                self._trial = None
                self.tried = trial.result()
        finally:
            trial.cancel()
