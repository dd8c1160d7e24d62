"""The state of a run, derived from its events and from nothing else.

What an event changes is in its own file (:mod:`procedures.steps`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import TYPE_CHECKING, Any, TypeVar

from hexacell.cell.recovery import FailureKind
from hexacell.identification.problem.random_walk import NO_WALK, GaugeWalk
from hexacell.kinematics.commanded_motion import RefusedCommand, RefusedCommands
from hexacell.kinematics.corrections import NO_CORRECTIONS
from hexacell.measurements.records import Directions, MeasurementSet, Record
from hexacell.results.term_result import FoundTerms
from procedures.run.keys import Phase, SetKey, SixNumbers, ThreeNumbers
from procedures.run.readings import Reading, temperatures_shown
from procedures.run.set_state import SetState

if TYPE_CHECKING:  # a state keeps events whole, and needs their names in its annotations alone
    from hexacell.checks.change_alarm import ChangeAlarm
    from hexacell.verdict.decision import Verdict, VerifiedAccuracy
    from procedures.steps import events

EventT = TypeVar("EventT", bound="events.BaseEvent")


@dataclass(frozen=True, slots=True)
class RunState:
    """A run as far as it got.

    Attributes:
        sets: by key, invalidated ones left out.
        noise: what was measured of it; None before that, or where the cell file does not ask for it.
        at_pose: the set and orientation of the pose that the robot is at; None if it is at none.
        target: the pose that it was last commanded to or located at.
        directions: from which side each joint arrived there; empty where nothing is known of that.
        off_plan: it is at a pose of no set: it was located there, or is at a waypoint.
        path_from_reference: orientations and poses by which it came from the reference it was at last;
            0 where nothing is measured.
        position_unknown: the controller must be asked for the pose before the robot moves.
        gauges_tried: they passed a trial, and nobody can have changed them since.
        excluded: poses that the controller refused, in the order of the refusals.
        off_plate: commands on the way to which the ball left its plates, with those near them.
        failures: how many, by kind and place, since the run was begun or resumed.
        confirmation: the records that show whether a test of the model failed by chance.
        rolling_back: the old geometry is being restored.
        provisional: the provisional geometry that the controller was given last.
        provisional_active: the controller has it now.
        is_in_estop: the controller came into emergency stop, and has not moved since.
        config_write_pending: it is being applied or reverted, and how far that got is unknown.
        recalled: why the run is to end at the reference of the set in which the robot is.
        others: the last event of each class that has no field here.
    """

    started: events.RunStarted | None = None
    sets: dict[SetKey, SetState] = field(default_factory=dict)
    at_pose: tuple[SetKey, int] | None = None
    target: SixNumbers | None = None
    directions: Directions = ()
    off_plan: bool = False
    path_from_reference: tuple[tuple[int, SixNumbers], ...] = ()
    position_unknown: bool = False
    invalidated: int = 0
    gauges_tried: bool = False
    noise: events.NoiseMeasured | None = None
    identified: events.Identified | None = None
    proposed: events.Proposed | None = None
    committed: events.Committed | None = None
    confirmation: events.ConfirmationPlanned | None = None
    judged: events.ResultValidated | None = None
    accepted: events.ResultAccepted | None = None
    rolled_back: bool = False
    rolling_back: bool = False
    provisional: events.ProvisionalApplied | None = None
    provisional_active: bool = False
    config_write_pending: bool = False
    excluded: tuple[events.PoseExcluded, ...] = ()
    off_plate: tuple[RefusedCommand, ...] = ()
    failures: dict[tuple[FailureKind, str], int] = field(default_factory=dict)
    is_in_estop: bool = False
    recalled: str | None = None
    ended: events.Ended | None = None
    others: Mapping[type[events.BaseEvent], events.BaseEvent] = field(default_factory=dict)

    def latest(self, kind: type[EventT]) -> EventT | None:
        """The last event of a class that has no field here; None if there was none."""
        found = self.others.get(kind)
        return found if isinstance(found, kind) else None

    def with_set(self, key: SetKey, value: SetState) -> RunState:
        """The state with another content of one set."""
        return replace(self, sets={**self.sets, key: value})

    def with_changed_set(self, key: SetKey, **changes: Any) -> RunState:  # noqa: ANN401 - of these fields
        """The state in which some fields of one set are others."""
        return self.with_set(key, replace(self.set(key), **changes))

    def without_position(self) -> RunState:
        """The state in which nobody knows where the robot is."""
        return replace(self, at_pose=None, position_unknown=True, directions=())

    def unverified(self, but: SetKey | None = None) -> RunState:
        """The state in which the gauges of all open sets but one may have been moved or switched off."""
        sets = {k: v if k == but else v.unverified() for k, v in self.sets.items()}
        return replace(self, sets=sets, gauges_tried=self.gauges_tried and but is not None)

    @property
    def is_unverified(self) -> bool:
        """Whether the controller has a new geometry on which no verdict was given."""
        return self.committed is not None and self.judged is None

    @property
    def found_terms(self) -> FoundTerms:
        """What was identified beside the geometry, and what the proposed config corrects."""
        terms = () if self.identified is None else self.identified.result.terms
        corrections = None if self.proposed is None else self.proposed.corrections
        return FoundTerms(terms, corrections or NO_CORRECTIONS)

    @property
    def open_sets(self) -> list[SetKey]:
        """The sets that are not closed, in the order in which they were begun."""
        return [key for key, measured in self.sets.items() if not measured.closed]

    @property
    def completed(self) -> int:
        """Number of records and closed sets, of which a run is made."""
        return sum(len(measured.samples) + measured.closed for measured in self.sets.values())

    def set(self, key: SetKey) -> SetState:
        """One set; an empty one where nothing was measured yet."""
        return self.sets.get(key, SetState())

    @property
    def sets_with_zero(self) -> list[SetKey]:
        """The sets that do not count if the gauges lost their zero.

        Of a length check these are all: its mountings have the zero of the first one.
        """
        first = SetKey(phase=Phase.LENGTH, point=1)
        is_checking = first in self.sets and self.judged is None
        return [*self.open_sets, *([first] if is_checking and first not in self.open_sets else [])]

    def zero(self, key: SetKey) -> Reading | None:
        """The reading that the deviations of a set are measured from; None before it is taken."""
        of_zero = SetKey(phase=Phase.LENGTH, point=1) if key.phase is Phase.LENGTH else key
        samples = self.set(of_zero).samples
        return samples[0].reading if samples else None

    @property
    def refused(self) -> RefusedCommands:
        """What the controller refused in this run, and where the ball left its plates."""
        by_controller = (RefusedCommand(one.pose, one.axis, one.is_highest) for one in self.excluded)
        return RefusedCommands((*by_controller, *self.off_plate))

    def is_left(self, key: SetKey) -> bool:
        """Whether a set cannot be measured, because its reference was refused."""
        is_refused = any(one.at == key and one.orientation == 1 for one in self.excluded)
        return is_refused and not self.set(key).samples

    def zero_shown(self, key: SetKey) -> ThreeNumbers | None:
        """What a set's gauges showed, mm along base x, y, z, when they were zeroed; None before that."""
        zero = self.zero(key)
        return None if zero is None else zero.gauges_mm

    def samples(self, phase: Phase) -> tuple[events.RecordTaken, ...]:
        """All records of a phase, in the order of their points."""
        keys = sorted((key for key in self.sets if key.phase is phase), key=lambda key: key.point)
        return tuple(sample for key in keys for sample in self.sets[key].samples)

    def measurements(self) -> MeasurementSet:
        """The records that the geometry is identified from; where gauges drift, with references again."""
        if not self.walk.step_mm:
            return MeasurementSet(tuple(sample.record for sample in self.samples(Phase.IDENTIFY)))
        keys = sorted((key for key in self.sets if key.phase is Phase.IDENTIFY), key=lambda key: key.point)
        measured = [(key, self.sets[key]) for key in keys if self.sets[key].samples]
        return MeasurementSet(
            tuple(record for key, one in measured for record in one.with_repeats(self._visits_of(key)))
        )

    @property
    def walk(self) -> GaugeWalk:
        """How the gauges drift, by the set that was closed last."""
        sets = self.sets.items()
        closed = [one.walk for key, one in sets if key.phase is Phase.IDENTIFY and one.closed]
        return closed[-1] if closed else NO_WALK

    def _visits_of(self, key: SetKey) -> tuple[Reading, ...]:
        """The visits of a set's reference after its first record, if that was not taken again then."""
        is_kept = self.noise is not None and self.noise.at == key and self.noise.noise.windows == 1
        return tuple(visit.reading for visit in self.set(key).visits) if is_kept else ()

    @property
    def pilots(self) -> tuple[Record, ...]:
        """The pilot records, in the order taken."""
        sets = [(key, measured) for key, measured in self.sets.items() if key.phase is Phase.IDENTIFY]
        return tuple(
            pilot.record(zero)
            for key, measured in sets
            for pilot in measured.pilots
            if (zero := self.zero(key)) is not None
        )

    def temperature_range_k(self, but: Collection[str] = ()) -> float | None:
        """The largest range that a thermometer showed with these records; None without readings.

        ``but``: the names of those that are left out if there are others.
        """
        shown = temperatures_shown(sample.reading for sample in self.samples(Phase.IDENTIFY))
        counted = shown.keys() - set(but) or shown.keys()
        return max((max(shown[name]) - min(shown[name]) for name in counted), default=None)

    @property
    def verdict(self) -> Verdict | None:
        """The verdict, if there is one."""
        return self.judged.verdict if self.judged else None

    @property
    def accuracy(self) -> VerifiedAccuracy | None:
        """The errors at the task poses that the verdict is on; None without such a verdict."""
        found = self.judged and (self.judged.verification or self.judged.check)
        return found.accuracy if found else None

    @property
    def alarm(self) -> ChangeAlarm | None:
        """The alarm that a check raised, if any."""
        alarm = self.judged and self.judged.check and self.judged.check.alarm
        return alarm if alarm and alarm.is_raised else None

    @property
    def left_travel(self) -> bool:
        """Whether the ball left the travel with the new geometry, in a set that was not completed."""
        verifying = [value for key, value in self.sets.items() if key.phase.has_new_geometry]
        return any(value.rejections and not value.closed for value in verifying)

    def held_out(self, phase: Phase) -> list[tuple[float, float, float]]:
        """Deviations, mm, at the held-out poses that are measured before and after; no references."""
        compared = [sample for sample in self.samples(phase) if sample.orientation > 1]
        if found := self.identified:  # a pose of one phase may have been refused in the other
            counts, allows = [len(poses) for poses in found.held_out], self.refused.allows
            compared = [s for s in compared if s.orientation <= counts[s.at.point - 1] and allows(s.pose)]
        return [sample.deviation_mm for sample in compared]


def fold(history: Iterable[events.BaseEvent]) -> RunState:
    """The state after these events."""
    return reduce(apply, history, RunState())


def apply(state: RunState, event: events.BaseEvent) -> RunState:
    """The state after one more event."""
    return event.applied_to(state)


def place_of(step: events.BaseStep | None) -> str:
    """Where failures are counted: the set of a step, or the key of a step that belongs to none."""
    return "deciding" if step is None else step.place
