"""Steps and events are data that survive JSON; the state of a run is a fold over its events."""

from typing import Any, get_args

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from hexacell.campaign.pilots import FIRST_PILOT
from hexacell.cell.devices import ThermometerSettings
from procedures.journal.journal import read_journal
from procedures.run.keys import Phase, SetKey
from procedures.run.readings import Reading, Temperature, mean_leg_temperatures, mean_temperature, on_parts
from procedures.run.state import RunState, apply, fold
from procedures.steps import events
from procedures.steps.close import CloseSet
from procedures.steps.events import EVENTS, STEPS, Step
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.roll_back import RollBack
from procedures.steps.sample import Sample
from tests.complete_models import complete
from tests.procedures.story import READING, an_identification, located
from tests.recorded_events import record

P1 = SetKey(phase=Phase.IDENTIFY, point=1)


def test_a_fold_applies_one_event_at_a_time(recording) -> None:
    state = RunState()
    for place, event in enumerate(recording.history, 1):
        state = apply(state, event)
        if place % 10 == 0:
            assert fold(recording.history[:place]) == state
    assert fold(recording.history) == state


def test_a_rejected_record_is_counted_and_voids_the_position(story) -> None:
    state = fold([story().arrived(2), story().refused(), story().arrived(2), story().refused()])
    assert state.set(P1).rejections == 2
    assert not state.left_travel, "it was not the new geometry that took the ball there"
    assert state.at_pose is None
    assert state.target == story().arrived(2).pose


@pytest.mark.parametrize(
    "event",
    [
        events.Interrupted(reason="killed", exit_code=130),
        events.Paused(at_once=True),
        located((0.0,) * 6),
        events.ProvisionalReverted(),
        events.Committed(approved_by="a tester"),
        events.RolledBack(),
    ],
    ids=lambda event: event.kind,
)
def test_directions_are_those_of_the_last_move_until_the_robot_was_lost(story, event) -> None:
    directions = (1, -1, 0, 1, 1, -1)
    arrived = story().arrived(2).model_copy(update={"directions": directions})
    state = fold([story().arrived(), arrived])
    assert apply(state, events.Paused(at_once=False)).directions == directions
    assert (apply(state, event).directions, apply(state, event).at_pose) == ((), None)


@pytest.mark.parametrize("directions", [(1,) * 3, (1,) * 7, (2, 0, 0, 0, 0, 0)])
def test_directions_are_of_each_joint_or_none(story, directions) -> None:
    arrived = story().arrived().model_dump()
    with pytest.raises(ValidationError, match="1, -1 or 0 for each joint"):
        events.Arrived(**{**arrived, "directions": directions})


def test_sets_are_invalidated_and_counted_and_records_stand_in_the_order_of_points(story) -> None:
    kept = story(point=2)
    state = fold([*kept.whole(2), *story().whole(2)[:-2], story().voided()])
    assert list(state.sets) == [kept.key]
    assert state.at_pose is None
    assert state.invalidated == 1
    told = [*story(point=2).whole(3), *story(Phase.BEFORE, 1).whole(2), *story(point=1).whole(2)]
    state = fold(told)
    labels = [(record.point, record.orientation) for record in state.measurements().records]
    assert labels == [(1, 1), (1, 2), (2, 1), (2, 2), (2, 3)]
    sampled = story().sampled(2, (0.5, -0.5, 0.125))
    record = fold([story().sampled(), sampled]).measurements().records[1]
    assert record.pose.as_tuple() == sampled.pose
    assert record.joints == sampled.reading.joints
    assert record.deviation == (0.5, -0.5, 0.125)


def test_the_range_of_temperatures_is_that_of_one_thermometer(story) -> None:
    """The room is colder than the rails, which is no change of temperature; one reading is missing."""

    def warm(sampled, **celsius):
        temperatures = tuple(Temperature(name=name, celsius=value) for name, value in celsius.items())
        reading = sampled.reading.model_copy(update={"temperatures": temperatures})
        return sampled.model_copy(update={"reading": reading})

    told = [
        warm(story().sampled(), room=19.0, rails=24.0),
        warm(story().sampled(2), room=19.5, rails=None),
        warm(story().sampled(3), room=19.25, rails=24.125),
    ]
    assert fold(told).temperature_range_k() == 0.5
    assert fold(told).temperature_range_k(["room"]) == 0.125
    assert fold(told).temperature_range_k(["room", "rails"]) == 0.5
    assert fold([story().sampled()]).temperature_range_k() is None


def test_held_out_deviations_leave_references_out(story) -> None:
    one, two = story(Phase.AFTER, 1), story(Phase.AFTER, 2)
    told = [
        one.sampled(1),
        one.sampled(2, (1.0, 0.0, 0.0)),
        two.sampled(1),
        two.sampled(2, (0.0, 2.0, 0.0)),
    ]
    state = fold(told)
    assert state.held_out(Phase.AFTER) == [(1.0, 0.0, 0.0), (0.0, 2.0, 0.0)]
    assert state.held_out(Phase.BEFORE) == []


def test_a_rollback_without_a_verdict_returns_to_the_proposal(story) -> None:
    after = story(Phase.AFTER)
    state = fold([events.Committed(approved_by="a tester"), *after.whole(2), events.RolledBack()])
    assert (state.committed, state.rolled_back, state.sets) == (None, False, {})


STOP = (1.0, 2.0, 500.0, 3.0, 0.0, 0.0)
OTHER_STOP = (4.0, 5.0, 500.0, 6.0, 0.0, 0.0)


def trail_of(*told: events.Event) -> list[int]:
    return [orientation for orientation, _ in fold(told).path_from_reference]


def test_the_trail_leads_back_to_the_reference_without_loops_unless_it_was_lost(story) -> None:
    s = story()
    assert trail_of() == []
    assert trail_of(s.arrived(1), s.arrived(2), s.arrived(0, STOP), s.arrived(3)) == [1, 2, 0, 3]
    there = [s.arrived(1), s.arrived(0, STOP), s.arrived(2), s.arrived(0, OTHER_STOP), s.arrived(3)]
    assert trail_of(*there, s.arrived(0, STOP)) == [1, 0]
    assert trail_of(*there, s.arrived(1)) == [1]
    assert trail_of(*there, s.arrived(2), s.arrived(4)) == [1, 0, 2, 4]
    s = story()
    lost = events.Interrupted(reason="a power cut", exit_code=130)
    there = [s.arrived(1), s.arrived(2), s.arrived(3), lost]
    assert trail_of(*there, located(STOP), s.arrived(4)) == []
    assert trail_of(*there, located(STOP), s.arrived(2)) == [1, 2]
    assert trail_of(*there, located(s.arrived(3).pose), s.arrived(4)) == [1, 2, 3, 4]


def test_a_refused_pose_leaves_the_robot_where_it_was_and_is_not_taken_again(story) -> None:
    told = story()
    taken = [told.arrived(), told.sampled(), told.arrived(2), told.sampled(2), told.undone(2)]
    (again,) = fold(taken).set(told.key).again
    before = fold([*taken, told.arrived()])
    after = apply(before, told.excluded(2, again[1]))
    assert after.set(told.key).again == ()
    assert (after.at_pose, after.target) == (before.at_pose, before.target)
    assert not after.refused.allows(again[1])
    assert before.target is not None
    assert after.refused.allows(before.target)


def test_a_set_whose_reference_is_refused_is_left_unless_it_has_records(story) -> None:
    told = story()
    refusal = told.excluded(1)
    assert fold([refusal]).is_left(told.key)
    assert not fold([told.excluded(2)]).is_left(told.key)
    assert not fold([told.arrived(), told.sampled(), refusal]).is_left(told.key)


ROOM = ThermometerSettings(name="room", path="/room")
PAIR = ThermometerSettings(name="pair", path="/pair", legs=(1, 2))
SIXTH = ThermometerSettings(name="sixth", path="/sixth", legs=(6,))
ALL = (ROOM, PAIR, SIXTH)


def sample(**celsius: float | None) -> Reading:
    shown = tuple(Temperature(name=name, celsius=one) for name, one in celsius.items())
    return READING.model_copy(update={"temperatures": shown})


SHOWN = (sample(room=5.0, pair=22.0, sixth=20.0), sample(room=5.0, pair=24.0, sixth=None))


def test_parts_have_the_temperatures_of_their_thermometers_and_means_are_of_legs_with_one() -> None:
    base = ThermometerSettings(name="room", path="/room", part="base")
    shown = [reading.temperatures for reading in SHOWN]
    assert on_parts((base, PAIR, SIXTH), shown[0]) == (22.0, 22.0, None, None, None, 20.0, 5.0)
    assert on_parts(ALL, shown[1]) == (24.0, 24.0, None, None, None, None, None)
    assert on_parts((SIXTH,), shown[1]) == ()
    assert mean_leg_temperatures(ALL, SHOWN) == (23.0, 23.0, None, None, None, 20.0)
    assert mean_leg_temperatures(ALL, [sample(pair=None)]) == (None,) * 6
    assert mean_leg_temperatures(ALL, []) == (None,) * 6
    assert mean_temperature(SHOWN) == 15.2
    assert mean_temperature([sample(room=None)]) is None


POSE = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
P2 = SetKey(phase=Phase.IDENTIFY, point=2)


@pytest.mark.parametrize(
    ("step", "key"),
    [
        (Move(at=P2, orientation=7, pose=POSE), "P2/o07/move"),
        (Sample(at=P2, orientation=11, pose=POSE), "P2/o11/sample"),
        (CloseSet(at=P2), "P2/close"),
        (Sample(at=SetKey(phase=Phase.BEFORE, point=1), orientation=2, pose=POSE), "before-V1/o02/sample"),
        (Move(at=SetKey(phase=Phase.AFTER, point=12), orientation=1, pose=POSE), "after-V12/o01/move"),
        (Pilot(at=P2, orientation=FIRST_PILOT + 2, pose=POSE), "P2/pilot03/pilot"),
        (Move(at=P2, orientation=FIRST_PILOT, pose=POSE), "P2/pilot01/move"),
        (RollBack(), "roll back"),
    ],
)
def test_keys_are_stable(step: Any, key: str) -> None:
    assert step.key == key


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
st.register_type_strategy(float, NUMBERS)  # for what is drawn by its annotation
SIX = st.just(()) | st.tuples(*[st.sampled_from([1, -1, 0])] * 6)
complete()
JOINTS = st.tuples(*[NUMBERS] * 5)
READINGS = st.builds(
    Reading, **(dict.fromkeys(Reading.model_fields, ...) | {"directions": SIX, "joints": JOINTS})
)
st.register_type_strategy(Reading, READINGS)
GEOMETRY = st.fixed_dictionaries({"S": st.tuples(*[st.tuples(*[NUMBERS] * 3)] * 6)})
RESULT = st.builds(an_identification, converged=st.booleans(), chi2=NUMBERS, frame=st.text())
GIVEN: dict[type[Any], dict[str, Any]] = {
    events.RunStarted: {"controller": GEOMETRY, "taught": GEOMETRY, "accepted": st.none()},
    events.ProvisionalApplied: {"geometry": GEOMETRY},
    events.Identified: {"result": RESULT, "improvement": st.none(), "quick": st.none()},
    events.ResultValidated: {"check": st.none(), "length": st.none()},
    events.Proposed: {"written": GEOMETRY},
    events.Arrived: {"directions": SIX},
    events.Located: {"joints": st.none() | JOINTS, "encoders": JOINTS},
    events.StandstillRead: {"joints": st.lists(JOINTS, max_size=2).map(tuple)},
}
"""What their annotations do not say, as that a geometry has lists of equal length; and what is large."""


def drawn(kind: type[Any]) -> st.SearchStrategy[Any]:
    """Any step or event of a kind, all of its fields drawn as they are annotated."""
    fields = dict.fromkeys(kind.model_fields.keys() - {"kind"}, ...)
    return st.builds(kind, **(fields | GIVEN.get(kind, {})))


@given(st.one_of([drawn(kind) for kind in STEPS]))
def test_steps_survive_json(step: Any) -> None:
    adapter: TypeAdapter[Step] = TypeAdapter(Step)
    assert repr(adapter.validate_json(adapter.dump_json(step))) == repr(step)


@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])  # events go to the disk
@given(history=st.lists(st.one_of([drawn(kind) for kind in EVENTS]), max_size=4))
def test_events_survive_the_journal(history: list[events.Event], tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("journal") / "journal.jsonl"
    record(path, history)
    assert repr(read_journal(path)) == repr(tuple(history))


def test_kinds_of_steps_and_events_are_different_and_never_change() -> None:
    steps = [kind.model_fields["kind"].default for kind in STEPS]
    assert sorted(steps) == sorted(STEP_KINDS)
    assert set(EVENTS) == set(get_args(get_args(events.Event)[0]))
    names = [kind.model_fields["kind"].default for kind in EVENTS]
    assert len(set(names)) == len(names)
    assert set(names) == set(KINDS)


STEP_KINDS = (
    *("move", "place", "sample", "revisit", "close", "locate", "standstill", "pilot", "repeat", "probe"),
    *("try", "assess noise", "lend", "take back", "identify", "propose", "commit", "judge", "accept"),
    "roll back",
)
KINDS = (
    *("started", "begun", "arrived", "placed", "sampled", "refused", "closed", "voided", "identified"),
    *("lent", "taken back", "proposed", "committed", "judged", "rolled back", "interrupted", "ended"),
    *("located", "undone", "confirmed", "paused", "resumed", "failed", "declined", "tripped"),
    *("accepted", "stood", "repeated", "probed", "tried", "noise measured", "excluded", "recalled"),
    *("confirmation planned", "piloted"),
)
"""Journals on disk say these words: they must never change."""
