"""Carries out the steps of a run; each gives the event that it caused."""

from __future__ import annotations

from dataclasses import dataclass

from procedures.resources.run_resources import RunResources
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, BaseStep


@dataclass(frozen=True, eq=False)
class StepExecutor(RunResources):
    """The resources of a run, with which its steps are carried out."""

    async def perform(self, step: BaseStep, state: RunState) -> BaseEvent:
        """Carry out one step; raises ``HexacellError``."""
        if not step.moves_nothing:
            await self.require_unedited_config(state)
        return await step.perform(self, state)
