"""A recorded robot does not move, so nothing can happen to it: its guards look away."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TypeVar

from hexacell.rotations import Array
from procedures.guards.guards import Guards
from procedures.guards.watching import Action
from procedures.performing import Performer
from procedures.state import RunState
from procedures.steps import Move

Result = TypeVar("Result")


class NoGuards(Guards):
    """Guards that let everything be done; what they judge by numbers alone, drift, they still judge."""

    async def prepare(self) -> None:
        """It is ready."""

    async def move(self, step: Move, state: RunState, commanded: Callable[[], Array]) -> None:
        """It is there."""
        del step, state, commanded

    async def stand(self, action: Action[Result]) -> Result:
        """Do it."""
        return await action()

    async def sample(self, action: Action[Result]) -> Result:
        """Take them."""
        return await action()

    async def reload(self) -> None:
        """It has read its config."""


class RecordedPerformer(Performer):
    """A performer whose devices are those of a journal."""

    @cached_property
    def guards(self) -> Guards:
        """None."""
        return NoGuards(self.cell.settings, self.devices, self.clock, self.folder.path)
