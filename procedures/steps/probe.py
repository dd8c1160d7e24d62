"""Probe: the gauges are read beside a set's reference, after a small known move of the ball."""

from typing import ClassVar, Literal

from hexacell.campaign.time_model import TimeKind
from procedures.resources.run_resources import RunResources
from procedures.run.keys import ThreeNumbers
from procedures.run.readings import Reading
from procedures.run.state import RunState
from procedures.steps.base import EventOfSet, StepOfSet


class GaugesProbed(EventOfSet):
    """The ball was moved by a small known distance from a set's reference, and the gauges were read."""

    kind: Literal["probed"] = "probed"
    moved_mm: ThreeNumbers
    reading: Reading

    def applied_to(self, state: RunState) -> RunState:
        return state.with_changed_set(self.at, probes=(*state.set(self.at).probes, self))


class Probe(StepOfSet):
    """Beside a set's reference, after a small known move of the ball: read the gauges."""

    kind: Literal["probe"] = "probe"
    moved_mm: ThreeNumbers

    outcomes: ClassVar = (GaugesProbed,)
    takes: ClassVar[TimeKind] = TimeKind.READING
    purpose: ClassVar[str] = "trying the gauges"

    async def perform(self, run: RunResources, state: RunState) -> GaugesProbed:
        return GaugesProbed(at=self.at, moved_mm=self.moved_mm, reading=await run.read(state))
