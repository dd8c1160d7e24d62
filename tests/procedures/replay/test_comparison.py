"""Two events side by side: numbers within rounding are the same, everything else is exact."""

import math
from pathlib import Path
from typing import Any

import pytest

from hexacell.cell.fields import Frozen
from hexacell.verdict.acceptance_gates import AcceptanceGate
from procedures.journal.journal import decode
from procedures.replay.replayer import Change, changes, is_wording
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.procedures.journal.conftest import checked
from tests.procedures.story import READING

KEY = SetKey(phase=Phase.BEFORE, point=2)


class Event(Frozen):
    """An event with something of any form in it."""

    result: dict[str, Any]


def event_with(**result: Any) -> Event:
    return Event(result=result)


@pytest.mark.parametrize(
    ("recorded", "replayed"),
    [
        (1.0, 1.0 + 9e-10),
        (-0.0, 0.0),
        (1e6, 1e6 + 9e-4),
        (math.nan, math.nan),
        (math.inf, math.inf),
        (0.0, 0),
        ([1.0, [2.0]], [1.0, [2.0 + 1e-12]]),
        ({"a": {"b": 1.0}}, {"a": {"b": 1.0, "new": 5}}),
        ("word", "word"),
        (None, None),
    ],
)
def test_values_within_the_tolerance_are_equal(recorded: Any, replayed: Any) -> None:
    assert changes(event_with(x=recorded), event_with(x=replayed), 1e-9) == []


@pytest.mark.parametrize(
    ("recorded", "replayed", "field"),
    [
        (1.0, 1.0 + 2e-9, "result.x"),
        (1.0, math.nan, "result.x"),
        (math.inf, -math.inf, "result.x"),
        (1.0, math.inf, "result.x"),
        (1.0, None, "result.x"),
        (None, 1.0, "result.x"),
        (1, 2, "result.x"),
        (True, False, "result.x"),
        ("word", "Word", "result.x"),
        ([1.0], [1.0, 2.0], "result.x"),
        ([1.0, 2.0], [1.0, 2.5], "result.x[1]"),
        ({"a": {"b": [0.0, [3.0]]}}, {"a": {"b": [0.0, [4.0]]}}, "result.x.a.b[1][0]"),
        ({"gone": 1.0}, {}, "result.x.gone"),
    ],
)
def test_a_different_field_is_named(recorded: Any, replayed: Any, field: str) -> None:
    [change] = changes(event_with(x=recorded), event_with(x=replayed), 1e-9)
    assert change.field == field


def test_a_field_missing_in_the_recorded_event_is_no_difference() -> None:
    body = b'{"kind":"refused","at":{"phase":"before-V","point":2},"orientation":2,"reason":"so"}'
    line = b'{"n":2,"at":"2026-11-20T10:30:00.000Z","s":1.5,"event":%b}' % body
    entry = decode(checked(line), Path("journal.jsonl"), 2)
    assert entry is not None
    again = events.RecordRejected(at=KEY, orientation=2, reason="so", reading=READING)
    assert changes(entry.event, again, 1e-9) == []
    assert changes(again, again.model_copy(update={"reading": None}), 1e-9) != []


def test_sentences_are_recognized_as_wording() -> None:
    gates = [AcceptanceGate(name="n", passed=True, sentence=words) for words in ("One.", "Two.")]
    first, second = (events.Proposed(gates=(gate,), written={}) for gate in gates)
    [change] = changes(first, second, 1e-9)
    assert change == Change("gates[0].sentence", "One.", "Two.")
    assert is_wording(change)
    assert not is_wording(Change("reading.line_up", 1, 2))
