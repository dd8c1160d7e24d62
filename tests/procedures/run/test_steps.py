"""Steps and events are data: stable names, and the same after a way through JSON."""

from __future__ import annotations

from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from hexacell.campaign.pilots import FIRST_PILOT
from procedures.journal.journal import Journal, read_journal
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from procedures.steps.assess_noise import AssessNoise
from procedures.steps.close import CloseSet
from procedures.steps.events import EVENTS
from procedures.steps.identify import Identify
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.place import Place
from procedures.steps.probe import Probe
from procedures.steps.registry import STEPS, Step
from procedures.steps.repeat import Repeat
from procedures.steps.roll_back import RollBack
from procedures.steps.sample import Sample
from procedures.steps.standstill import Standstill
from procedures.steps.try_gauges import Try
from tests.procedures.identified import an_identification

POSE = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
P2 = SetKey(phase=Phase.IDENTIFY, point=2)


@pytest.mark.parametrize(
    ("step", "key"),
    [
        (Move(at=P2, orientation=7, pose=POSE), "P2/o07/move"),
        (Place(at=P2, pose=POSE), "P2/place"),
        (Sample(at=P2, orientation=7, pose=POSE), "P2/o07/sample"),
        (Sample(at=P2, orientation=11, pose=POSE), "P2/o11/sample"),
        (CloseSet(at=P2), "P2/close"),
        (Sample(at=SetKey(phase=Phase.BEFORE, point=1), orientation=2, pose=POSE), "before-V1/o02/sample"),
        (Move(at=SetKey(phase=Phase.AFTER, point=12), orientation=1, pose=POSE), "after-V12/o01/move"),
        (Standstill(at=P2), "P2/standstill"),
        (Pilot(at=P2, orientation=FIRST_PILOT + 2, pose=POSE), "P2/pilot03/pilot"),
        (Move(at=P2, orientation=FIRST_PILOT, pose=POSE), "P2/pilot01/move"),
        (Repeat(at=P2), "P2/repeat"),
        (Probe(at=P2, moved_mm=(1.0, 0.0, 0.0)), "P2/probe"),
        (Try(at=P2), "P2/try"),
        (AssessNoise(), "assess noise"),
        (Identify(), "identify"),
        (RollBack(), "roll back"),
    ],
)
def test_keys_are_stable(step: Any, key: str) -> None:
    assert step.key == key


def test_the_target_of_a_move_is_its_pose() -> None:
    assert Move(at=P2, orientation=1, pose=POSE).target.as_tuple() == POSE


def test_steps_do_not_change() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        setattr(CloseSet(at=P2), "at", P2)  # noqa: B010 - not even so


def test_unknown_keys_are_refused() -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(Step).validate_python({"kind": "close", "at": {"phase": "P", "point": 1}, "why": 1})


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
st.register_type_strategy(float, NUMBERS)  # for what is drawn by its annotation
GEOMETRY = st.fixed_dictionaries({"S": st.tuples(*[st.tuples(*[NUMBERS] * 3)] * 6)})
RESULT = st.builds(an_identification, converged=st.booleans(), chi2=NUMBERS, frame=st.text())
GIVEN: dict[type[Any], dict[str, Any]] = {
    events.RunStarted: {"controller": GEOMETRY, "taught": GEOMETRY},
    events.ProvisionalApplied: {"geometry": GEOMETRY},
    events.Identified: {"result": RESULT},
    events.Proposed: {"written": GEOMETRY},
}
"""What their annotations do not say: a geometry has lists of equal length."""


def drawn(kind: type[Any]) -> st.SearchStrategy[Any]:
    """Any step or event of a kind, all of its fields drawn as they are annotated."""
    fields = dict.fromkeys(kind.model_fields.keys() - {"kind"}, ...)
    return st.builds(kind, **(fields | GIVEN.get(kind, {})))


@given(st.one_of([drawn(kind) for kind in STEPS]))
def test_steps_survive_json(step: Any) -> None:
    adapter: TypeAdapter[Step] = TypeAdapter(Step)
    assert repr(adapter.validate_json(adapter.dump_json(step))) == repr(step)


@settings(max_examples=25)  # each forces every event to the disk
@given(history=st.lists(st.one_of([drawn(kind) for kind in EVENTS]), max_size=4))
def test_events_survive_the_journal(history: list[events.Event], tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("journal") / "journal.jsonl"
    with Journal(path) as journal:
        for event in history:
            journal.append(event)
    assert repr(read_journal(path)) == repr(tuple(history))


def test_kinds_of_events_are_different_and_never_change() -> None:
    assert set(EVENTS) == set(get_args(get_args(events.Event)[0]))
    names = [kind.model_fields["kind"].default for kind in EVENTS]
    assert len(set(names)) == len(names)
    assert set(names) == set(KINDS)


KINDS = (
    *("started", "begun", "arrived", "placed", "sampled", "refused", "closed", "voided", "identified"),
    *("lent", "taken back", "proposed", "committed", "judged", "rolled back", "interrupted", "ended"),
    *("located", "undone", "confirmed", "paused", "resumed", "failed", "declined", "tripped"),
    *("accepted", "stood", "repeated", "probed", "tried", "noise measured", "excluded", "recalled"),
    *("confirmation planned", "piloted"),
)
"""Journals on disk say these words: they must never change."""
