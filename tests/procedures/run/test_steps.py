"""Steps and events are data: stable names, and the same after a way through JSON."""

from __future__ import annotations

from typing import Any, get_args

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from hexacell.campaign.pilots import FIRST_PILOT
from procedures.journal.journal import Journal, read_journal
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from procedures.steps.close import CloseSet
from procedures.steps.events import EVENTS
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.registry import STEPS, Step
from procedures.steps.roll_back import RollBack
from procedures.steps.sample import Sample
from tests.procedures.story import an_identification

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
GEOMETRY = st.fixed_dictionaries({"S": st.tuples(*[st.tuples(*[NUMBERS] * 3)] * 6)})
RESULT = st.builds(an_identification, converged=st.booleans(), chi2=NUMBERS, frame=st.text())
GIVEN: dict[type[Any], dict[str, Any]] = {
    events.RunStarted: {"controller": GEOMETRY, "taught": GEOMETRY, "accepted": st.none()},
    events.ProvisionalApplied: {"geometry": GEOMETRY},
    events.Identified: {"result": RESULT, "improvement": st.none(), "quick": st.none()},
    events.ResultValidated: {"check": st.none(), "length": st.none()},
    events.Proposed: {"written": GEOMETRY},
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
    with Journal(path) as journal:
        for event in history:
            journal.append(event)
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
