"""Repeat: a set's reference is read again from another direction, which shows how well it repeats."""

from typing import ClassVar, Literal

from hexacell.campaign.time_model import TimeKind
from procedures.resources.run_resources import RunResources
from procedures.run.readings import Reading
from procedures.run.state import RunState
from procedures.steps.base import EventOfSet, StepOfSet


class ReferenceRepeated(EventOfSet):
    """The reference was left, visited again from another direction, and read."""

    kind: Literal["repeated"] = "repeated"
    reading: Reading

    def applied_to(self, state: RunState) -> RunState:
        visits = (*state.set(self.at).visits, self)
        return state.with_changed_set(self.at, visits=visits, has_left=False, piloted=0)


class Repeat(StepOfSet):
    """Back at a set's reference from another direction: read again, which shows how well it repeats."""

    kind: Literal["repeat"] = "repeat"

    outcomes: ClassVar = (ReferenceRepeated,)
    takes: ClassVar[TimeKind] = TimeKind.READING
    purpose: ClassVar[str] = "measuring the noise"

    async def perform(self, run: RunResources, state: RunState) -> ReferenceRepeated:
        return ReferenceRepeated(at=self.at, reading=await run.read(state))
