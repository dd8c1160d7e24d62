"""Where a run stands: a fold over its events, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import reduce

from hexacell.measurements import MeasurementSet, Record
from hexacell.pose import Pose
from procedures import events
from procedures.steps import Phase, SetKey, SixNumbers


@dataclass(frozen=True, slots=True)
class SetState:
    """One set as far as it is measured."""

    samples: tuple[events.Sampled, ...] = ()
    placed: bool = False
    refusals: int = 0
    drift_mm: tuple[float, float, float] | None = None

    @property
    def closed(self) -> bool:
        """Whether its reference was read again at the end."""
        return self.drift_mm is not None


@dataclass(frozen=True, slots=True)
class RunState:
    """A run as far as it got.

    Attributes:
        sets: by key, voided ones left out.
        standing: the set and orientation whose pose the robot holds, if it is known, and
            ``target``, that pose as it was commanded.
    """

    started: events.RunStarted | None = None
    sets: dict[SetKey, SetState] = field(default_factory=dict)
    standing: tuple[SetKey, int] | None = None
    target: SixNumbers | None = None
    voided: int = 0
    identified: events.Identified | None = None
    proposed: events.Proposed | None = None
    committed: events.Committed | None = None
    judged: events.Judged | None = None
    rolled_back: bool = False
    ended: events.Ended | None = None

    def set(self, key: SetKey) -> SetState:
        """One set; an empty one where nothing was measured yet."""
        return self.sets.get(key, SetState())

    def samples(self, phase: Phase) -> tuple[events.Sampled, ...]:
        """All records of a phase, in the order of their points."""
        keys = sorted((key for key in self.sets if key.phase is phase), key=lambda key: key.point)
        return tuple(sample for key in keys for sample in self.sets[key].samples)

    def measurements(self) -> MeasurementSet:
        """The records that the geometry is identified from."""
        return MeasurementSet(tuple(_record(sample) for sample in self.samples(Phase.IDENTIFY)))

    def refusals(self, phase: Phase) -> int:
        """How many records of a phase were refused."""
        return sum(value.refusals for key, value in self.sets.items() if key.phase is phase)

    def held_out(self, phase: Phase) -> list[tuple[float, float, float]]:
        """Deviations at held-out poses, mm, references left out."""
        return [sample.deviation_mm for sample in self.samples(phase) if sample.orientation > 1]


def fold(history: Iterable[events.Event]) -> RunState:
    """Where a run stands after these events."""
    return reduce(apply, history, RunState())


def apply(state: RunState, event: events.Event) -> RunState:  # noqa: C901, PLR0911, PLR0912 - a case an event
    """The state after one more event."""
    match event:
        case events.RunStarted():
            return replace(state, started=event)
        case events.Arrived():
            return replace(state, standing=(event.at, event.orientation), target=event.pose)
        case events.Placed():
            return _with_set(state, event.at, replace(state.set(event.at), placed=True))
        case events.Sampled():
            before = state.set(event.at)
            return _with_set(state, event.at, replace(before, samples=(*before.samples, event)))
        case events.Refused():
            before = state.set(event.at)
            standing_nowhere = replace(state, standing=None)
            return _with_set(standing_nowhere, event.at, replace(before, refusals=before.refusals + 1))
        case events.SetClosed():
            return _with_set(state, event.at, replace(state.set(event.at), drift_mm=event.drift_mm))
        case events.SetVoided():
            kept = {key: value for key, value in state.sets.items() if key != event.at}
            return replace(state, sets=kept, standing=None, voided=state.voided + 1)
        case events.Identified():
            return replace(state, identified=event)
        case events.Proposed():
            return replace(state, proposed=event)
        case events.Committed():
            return replace(state, committed=event, standing=None)
        case events.Judged():
            return replace(state, judged=event)
        case events.RolledBack():
            return replace(state, rolled_back=True, standing=None)
        case events.Interrupted():
            return replace(state, standing=None)
        case events.Ended():
            return replace(state, ended=event)
        case _:
            return state


def _with_set(state: RunState, key: SetKey, value: SetState) -> RunState:
    return replace(state, sets={**state.sets, key: value})


def _record(sample: events.Sampled) -> Record:
    return Record(
        sample.at.point,
        sample.orientation,
        Pose(*sample.pose),
        sample.reading.joints_mm,
        sample.deviation_mm,
    )
