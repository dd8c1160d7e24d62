"""The state of a run: a fold over its events, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np

from hexacell.cell.recovery import Action, FailureKind
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.refused_commands import RefusedCommand, RefusedCommands
from hexacell.measurements.records import MeasurementSet, Record, deviation_of
from procedures.run import events
from procedures.run.set_state import SetState
from procedures.run.steps import (
    Compute,
    Move,
    Phase,
    SetKey,
    SixNumbers,
    Step,
    StepOfSet,
    ThreeNumbers,
)
from procedures.run.trips import Guard


@dataclass(frozen=True, slots=True)
class RunState:
    """A run as far as it got.

    Attributes:
        sets: by key, invalidated ones left out.
        noise: what was measured of it; none before that, or where the cell file does not ask for it.
        at_pose: the set and orientation of the pose that the robot is at; None if it is at none.
        target: the pose that it was last commanded to or located at.
        off_plan: it is at a pose of no set: it was located there, or is at a waypoint.
        path_from_reference: orientations and poses by which it came from the reference it was at last;
            0 where nothing is measured.
        position_unknown: the controller must be asked for the pose before the robot moves.
        excluded: poses that the controller refused, in the order of the refusals.
        failures: how many, by kind and place, since the run was begun or resumed.
        confirmation: the records that are to tell whether a test of the model failed by chance.
        rolling_back: the old geometry is being put back.
        provisional: the provisional geometry that the controller was given last.
        provisional_active: the controller has it now.
        is_in_estop: the controller came into emergency stop, and has not moved since.
        config_write_pending: it is being applied or reverted, and how far that got is unknown.
    """

    started: events.RunStarted | None = None
    sets: dict[SetKey, SetState] = field(default_factory=dict)
    at_pose: tuple[SetKey, int] | None = None
    target: SixNumbers | None = None
    off_plan: bool = False
    path_from_reference: tuple[tuple[int, SixNumbers], ...] = ()
    position_unknown: bool = False
    invalidated: int = 0
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
    failures: dict[tuple[FailureKind, str], int] = field(default_factory=dict)
    is_in_estop: bool = False
    recalled: str | None = None
    ended: events.Ended | None = None

    @property
    def is_unverified(self) -> bool:
        """Whether the controller has a new geometry on which no verdict was given."""
        return self.committed is not None and self.judged is None

    @property
    def open_sets(self) -> list[SetKey]:
        """The sets that are not closed, in the order in which they were begun."""
        return [key for key, measured in self.sets.items() if not measured.closed]

    @property
    def completed(self) -> int:
        """Number of records and closed sets, of which a run is made."""
        return sum(len(measured.samples) + measured.closed for measured in self.sets.values())

    def attempts(self, kind: FailureKind, step: Step | None) -> int:
        """How often a step, or another one of its set, failed in this way."""
        return self.failures.get((kind, _place_of(step)), 0)

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

    def zero(self, key: SetKey) -> events.Reading | None:
        """The reading that the deviations of a set are measured from; none before it is taken."""
        of_zero = SetKey(phase=Phase.LENGTH, point=1) if key.phase is Phase.LENGTH else key
        samples = self.set(of_zero).samples
        return samples[0].reading if samples else None

    @property
    def refused(self) -> RefusedCommands:
        """The commands that the controller refused in this run."""
        return RefusedCommands(
            tuple(RefusedCommand(one.pose, one.axis, one.is_highest) for one in self.excluded)
        )

    def is_left(self, key: SetKey) -> bool:
        """Whether a set cannot be measured, because its reference was refused."""
        is_refused = any(one.at == key and one.orientation == 1 for one in self.excluded)
        return is_refused and not self.set(key).samples

    def zero_shown(self, key: SetKey) -> ThreeNumbers | None:
        """What a set's gauges showed, mm along base x, y, z, when they were zeroed; none before that."""
        zero = self.zero(key)
        return None if zero is None else zero.gauges_mm

    def samples(self, phase: Phase) -> tuple[events.RecordTaken, ...]:
        """All records of a phase, in the order of their points."""
        keys = sorted((key for key in self.sets if key.phase is phase), key=lambda key: key.point)
        return tuple(sample for key in keys for sample in self.sets[key].samples)

    def measurements(self) -> MeasurementSet:
        """The records that the geometry is identified from."""
        return MeasurementSet(tuple(record(sample) for sample in self.samples(Phase.IDENTIFY)))

    @property
    def pilots(self) -> tuple[Record, ...]:
        """The pilot records, in the order taken."""
        sets = [(key, measured) for key, measured in self.sets.items() if key.phase is Phase.IDENTIFY]
        return tuple(
            _pilot_record(pilot, zero)
            for key, measured in sets
            for pilot in measured.pilots
            if (zero := self.zero(key)) is not None
        )

    @property
    def temperature_range_k(self) -> float | None:
        """The largest range that a thermometer showed with these records; none without readings."""
        shown: dict[str, list[float]] = {}
        for sample in self.samples(Phase.IDENTIFY):
            for temperature in sample.reading.temperatures:
                if temperature.celsius is not None:
                    shown.setdefault(temperature.name, []).append(temperature.celsius)
        return max((max(values) - min(values) for values in shown.values()), default=None)

    @property
    def left_travel(self) -> bool:
        """Whether the ball left the travel with the new geometry, in a set that was not completed."""
        verifying = [value for key, value in self.sets.items() if key.phase.has_new_geometry]
        return any(value.rejections and not value.closed for value in verifying)

    def held_out(self, phase: Phase) -> list[tuple[float, float, float]]:
        """Deviations, mm, at the held-out poses that are measured before and after; no references."""
        return [sample.deviation_mm for sample in self.samples(phase) if self._is_compared(sample)]

    def _is_compared(self, sample: events.RecordTaken) -> bool:
        if sample.orientation == 1 or self.identified is None:
            return sample.orientation > 1
        if not self.refused.allows(sample.pose):
            return False  # it may have been refused in the other phase
        return sample.orientation <= len(self.identified.held_out[sample.at.point - 1])


def fold(history: Iterable[events.Event]) -> RunState:
    """The state after these events."""
    return reduce(apply, history, RunState())


def apply(state: RunState, event: events.Event) -> RunState:  # noqa: C901, PLR0911, PLR0912 - a case an event
    """The state after one more event."""
    match event:
        case events.RunStarted():
            return replace(state, started=event, position_unknown=True)
        case events.StepBegun(step=Compute(kind="roll back")):
            return replace(state, rolling_back=True)
        case events.StepBegun(step=Compute(kind="lend" | "take back")):
            return replace(state, config_write_pending=True)
        case events.ProvisionalApplied():
            applied = replace(state, provisional=event, provisional_active=True, config_write_pending=False)
            return _without_position(applied)
        case events.ProvisionalReverted():
            return _without_position(replace(state, provisional_active=False, config_write_pending=False))
        case events.Located():
            return replace(state, at_pose=None, off_plan=True, target=event.pose, position_unknown=False)
        case events.Arrived():
            return _unverified(_arrived(state, event), but=event.at)
        case events.PoseExcluded():
            return _excluded(state, event)
        case events.GaugesPlaced():
            return _with_set(state, event.at, replace(state.set(event.at), placed=True))
        case events.RecordTaken():
            return _with_set(state, event.at, state.set(event.at).with_sample(event))
        case events.RecordRejected():
            return _rejected(state, event)
        case events.RecordDiscarded():
            return _with_set(state, event.at, state.set(event.at).without(event.orientation))
        case events.ReferenceConfirmed():
            return _with_set(state, event.at, replace(state.set(event.at), reference_unverified=False))
        case events.StandstillRead():
            return _with_set(state, event.at, replace(state.set(event.at), standstill=event))
        case events.PilotTaken():
            return _with_set(state, event.at, state.set(event.at).with_pilot(event))
        case events.ReferenceRepeated():
            return _with_set(state, event.at, state.set(event.at).with_visit(event))
        case events.GaugesProbed():
            probes = (*state.set(event.at).probes, event)
            return _with_set(state, event.at, replace(state.set(event.at), probes=probes))
        case events.GaugesTried():
            return _with_set(state, event.at, replace(state.set(event.at), tried=True, has_left=False))
        case events.NoiseMeasured():
            return _noise_measured(state, event)
        case events.SetClosed():
            return _with_set(state, event.at, replace(state.set(event.at), drift_mm=event.drift_mm))
        case events.SetInvalidated():
            return _invalidated(state, event.at)
        case events.Identified():
            return replace(state, identified=event)
        case events.Proposed():
            return replace(state, proposed=event)
        case events.Committed():
            # The same sliders are another pose under another geometry.
            return _without_position(replace(state, committed=event))
        case events.ConfirmationPlanned():
            return replace(state, confirmation=event)
        case events.ResultValidated():
            return replace(state, judged=event)
        case events.ResultAccepted():
            return replace(state, accepted=event)
        case events.RolledBack():
            return _rolled_back(_without_position(replace(state, rolling_back=False)))
        case events.Paused(at_once=True):
            return _unverified(_without_position(state))
        case events.Tripped(guard=Guard.EMERGENCY_STOP):
            return replace(state, is_in_estop=True)
        case events.Failed():
            return _failed(_without_position(state), event)
        case events.Interrupted():
            return _unverified(replace(_without_position(state), failures={}, recalled=None))
        case events.RunRecalled():
            return replace(state, recalled=event.reason)
        case events.Ended():
            return replace(state, ended=event)
        case _:
            return state


def _arrived(state: RunState, event: events.Arrived) -> RunState:
    is_waypoint = event.orientation == 0
    if event.orientation != 1 and event.at in state.sets:
        state = _with_set(state, event.at, replace(state.set(event.at), has_left=True))
    at_pose = None if is_waypoint else (event.at, event.orientation)
    return replace(
        state,
        at_pose=at_pose,
        off_plan=is_waypoint,
        target=event.pose,
        path_from_reference=_path(state, event),
        position_unknown=False,
        is_in_estop=False,
    )


def _excluded(state: RunState, event: events.PoseExcluded) -> RunState:
    """The robot is where it was; a record that was to be taken again there is chosen anew."""
    left = replace(state, excluded=(*state.excluded, event), identified=_with_replacements(state, event))
    if event.at not in state.sets:
        return left
    measured = state.set(event.at)
    again = tuple(pair for pair in measured.again if pair[1] != event.pose)
    return _with_set(left, event.at, replace(measured, again=again))


def _with_replacements(state: RunState, event: events.PoseExcluded) -> events.Identified | None:
    """The identification with other held-out poses in the place of those that cannot be commanded."""
    found, place = state.identified, dict(event.replacements)
    if found is None or not place:
        return found
    lists = {
        name: tuple(tuple(place.get(pose, pose) for pose in poses) for poses in getattr(found, name))
        for name in ("held_out", "held_out_after")
    }
    return found.model_copy(update=lists)


def _noise_measured(state: RunState, event: events.NoiseMeasured) -> RunState:
    """The reference is recorded again where later records are means of more windows."""
    measured = state.set(event.at)
    again = () if event.noise.windows > 1 else measured.samples
    return _with_set(replace(state, noise=event), event.at, replace(measured, samples=again))


def _rejected(state: RunState, event: events.RecordRejected) -> RunState:
    """At the pose the ball was outside the travel; before it, a guard stopped the robot on the way."""
    rejected = state.set(event.at).with_rejection(event.orientation)
    is_on_the_way = event.at.phase.has_new_geometry and state.at_pose != (event.at, event.orientation)
    left = _without_position(state) if is_on_the_way else replace(state, at_pose=None)
    # With the new geometry it may be a verdict, so it is verified first that the gauges are as they were.
    is_verified = not event.at.phase.has_new_geometry or rejected.rejections > 1
    return _with_set(left, event.at, rejected if is_verified else rejected.unverified())


def _invalidated(state: RunState, at: SetKey) -> RunState:
    """Without a set; a mounting of a length check whose zero is in doubt takes all of them with it."""
    takes_all = at.phase is Phase.LENGTH and bool(state.set(at).samples)
    lost = {key for key in state.sets if key == at or (takes_all and key.phase is Phase.LENGTH)}
    kept = {key: value for key, value in state.sets.items() if key not in lost}
    return replace(state, sets=kept, at_pose=None, invalidated=state.invalidated + 1)


def _path(state: RunState, event: events.Arrived) -> tuple[tuple[int, SixNumbers], ...]:
    """The path without loops; empty if the robot did not start from its end."""
    poses = [pose for _, pose in state.path_from_reference]
    if event.orientation == 1:
        return ((1, event.pose),)
    if event.pose in poses:
        return state.path_from_reference[: poses.index(event.pose) + 1]
    is_at_its_end = not state.position_unknown and bool(poses) and state.target == poses[-1]
    return (*state.path_from_reference, (event.orientation, event.pose)) if is_at_its_end else ()


def _without_position(state: RunState) -> RunState:
    return replace(state, at_pose=None, position_unknown=True)


def _unverified(state: RunState, but: SetKey | None = None) -> RunState:
    """All open sets but one become unverified: gauges are carried away, slip, or are switched off."""
    return replace(state, sets={k: v if k == but else v.unverified() for k, v in state.sets.items()})


def _failed(state: RunState, event: events.Failed) -> RunState:
    where = (event.failure, _place_of(event.step))
    counted = replace(state, failures={**state.failures, where: event.attempt})
    is_off_plate = event.failure is FailureKind.GAUGE_AT_END and event.action is not Action.REDO_SET
    match event.step:
        # The ball left its plate on the move to a chosen pose: another pose is chosen.
        case Move(at=at, orientation=orientation) if is_off_plate and at.phase is Phase.IDENTIFY:
            counted = _with_set(counted, at, counted.set(at).with_rejection(orientation))
    return _unverified(counted) if event.action is Action.MEASURE_AGAIN else counted


def _rolled_back(state: RunState) -> RunState:
    """Without a verdict the proposal is open again, and the sets measured after it do not count."""
    if state.judged is not None:
        return replace(state, rolled_back=True)
    kept = {key: value for key, value in state.sets.items() if not key.phase.has_new_geometry}
    return replace(state, committed=None, confirmation=None, sets=kept)


def _place_of(step: Step | None) -> str:
    """Where failures are counted: the set of a step, or the key of a step that belongs to none."""
    if step is None:
        return "deciding"
    return str(step.at) if isinstance(step, StepOfSet) else step.key


def _with_set(state: RunState, key: SetKey, value: SetState) -> RunState:
    return replace(state, sets={**state.sets, key: value})


def _pilot_record(pilot: events.PilotTaken, zero: events.Reading) -> Record:
    deviation = deviation_of(np.subtract(pilot.reading.gauges_mm, zero.gauges_mm))
    return Record(pilot.at.point, pilot.orientation, Pose(*pilot.pose), pilot.reading.joints, deviation)


def record(sample: events.RecordTaken) -> Record:
    """The record for the identification."""
    return Record(
        sample.at.point,
        sample.orientation,
        Pose(*sample.pose),
        sample.reading.joints,
        sample.deviation_mm,
    )
