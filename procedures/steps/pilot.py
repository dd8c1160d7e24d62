"""Pilot: the gauges are read where the reference was left, which steers the choice of poses."""

from typing import ClassVar, Literal

from hexacell.campaign.time_model import TimeKind
from hexacell.measurements.records import Record
from procedures.resources.run_resources import RunResources
from procedures.run.readings import Reading
from procedures.run.state import RunState
from procedures.steps.base import EventAtPose, StepAtPose
from procedures.steps.sample import RecordRejected, read_inside, record_of


class PilotTaken(EventAtPose):
    """The reference was left for a pilot pose, and the gauges were read there."""

    kind: Literal["piloted"] = "piloted"
    reading: Reading

    def record(self, zero: Reading) -> Record:
        """The record for the choice of poses; ``zero`` is the reading at the set's reference."""
        return record_of(self, self.reading, self.reading.deviation_from(zero))

    def applied_to(self, state: RunState) -> RunState:
        measured = state.set(self.at)
        pilots, piloted = (*measured.pilots, self), measured.piloted + 1
        return state.with_changed_set(self.at, pilots=pilots, piloted=piloted)


class Pilot(StepAtPose):
    """Read the gauges where the reference was left: that steers the choice of poses, and nothing else."""

    kind: Literal["pilot"] = "pilot"

    outcomes: ClassVar = (PilotTaken, RecordRejected)
    takes: ClassVar[TimeKind] = TimeKind.READING

    async def perform(self, run: RunResources, state: RunState) -> PilotTaken | RecordRejected:
        reading = await read_inside(self, run, state)
        if isinstance(reading, RecordRejected):
            return reading
        return PilotTaken(at=self.at, orientation=self.orientation, pose=self.pose, reading=reading)
