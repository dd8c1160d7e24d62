"""Standstill: all devices are read again and again while nothing moves, which shows their noise."""

from typing import ClassVar, Literal

from hexacell.campaign.time_model import TimeKind
from procedures.resources.run_resources import RunResources
from procedures.run.keys import SetKey
from procedures.run.readings import ReadingSeries
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, StepOfSet


class StandstillRead(ReadingSeries, BaseEvent):
    """The devices were read again and again at a reference while nothing moved."""

    kind: Literal["stood"] = "stood"
    at: SetKey

    def applied_to(self, state: RunState) -> RunState:
        return state.with_changed_set(self.at, standstill=self)


class Standstill(StepOfSet):
    """At a set's reference: read all devices again and again without moving, which shows their noise."""

    kind: Literal["standstill"] = "standstill"

    outcomes: ClassVar = (StandstillRead,)
    takes: ClassVar[TimeKind] = TimeKind.READING
    purpose: ClassVar[str] = "measuring the noise"

    async def perform(self, run: RunResources, state: RunState) -> StandstillRead:
        series = await run.read_series(run.settings.noise.standstill_readings)
        return StandstillRead(at=self.at, **dict(series))
