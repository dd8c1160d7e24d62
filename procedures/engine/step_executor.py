"""Decides on the steps of a run and carries them out; each gives the event that it caused."""

from __future__ import annotations

from dataclasses import dataclass

from procedures.resources.run_resources import RunResources
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, BaseStep
from procedures.workflow.next_step import next_step


@dataclass(frozen=True, eq=False)
class StepExecutor(RunResources):
    """The resources of a run, with which its steps are carried out."""

    def next_step(self, state: RunState) -> BaseStep | None:
        """The step to carry out; None if the run is over. Raises ``HexacellError`` if none is possible."""
        return next_step(self.calibration, state)

    async def perform(self, step: BaseStep, state: RunState) -> BaseEvent:
        """Carry out one step; raises ``HexacellError``."""
        if not step.moves_nothing:
            await self.require_unedited_config(state)
        return await step.perform(self, state)
