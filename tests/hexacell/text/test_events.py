"""Text for events: what the run does now, and the lines that a run prints."""

from typing import Any

from hexacell.campaign.decisions import Forecast
from hexacell.cell.recovery import Action, FailureKind
from hexacell.text.line_face import EventFormatter, activity, event_text
from procedures.run.keys import Phase, SetKey
from procedures.run.readings import Reading
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.move import Expectation, Move

POSE = (0.0,) * 6
ZERO = (0.0, 0.0, 0.0)
POINT = SetKey(phase=Phase.IDENTIFY, point=2)
HELD_OUT = SetKey(phase=Phase.BEFORE, point=1)
FORECAST = Forecast(now_mm=0.31, next_mm=0.29, end_mm=0.06, records=24, minutes=12.4)
READING = Reading(gauges_mm=ZERO, spread_mm=ZERO, joints=POSE, answers=(), counts=(), skews_s=())


def move(at: SetKey, orientation: int, forecast: Forecast | None = None) -> events.StepBegun:
    expected = Expectation(deviation_mm=ZERO, sigma_mm=ZERO, gain=1.0, forecast=forecast)
    step = Move(at=at, orientation=orientation, pose=POSE, expected=expected if forecast else None)
    return events.StepBegun(step=step)


def taken(at: SetKey, orientation: int, deviation_mm: tuple[float, float, float]) -> events.RecordTaken:
    return events.RecordTaken(
        at=at, orientation=orientation, pose=POSE, reading=READING, deviation_mm=deviation_mm
    )


def closed(at: SetKey) -> list[Any]:
    """Two records and the closing of their set."""
    end = events.SetClosed(at=at, drift_mm=(0.0, -0.02, 0.01), reading=READING)
    return [taken(at, 1, ZERO), taken(at, 2, (0.5, -1.25, 0.0)), end]


def test_a_move_has_its_place_and_the_predicted_error():
    assert activity(move(POINT, 7, FORECAST)) == "point 2, orientation 7: 0.310 -> 0.060 mm"
    assert activity(move(HELD_OUT, 1)) == "held-out point 1, before, orientation 1"
    assert activity(events.Paused()) is None


def test_a_set_with_fewer_records_than_planned_says_why():
    *before, end = closed(POINT)
    short = end.model_copy(update={"reason": "no safe straight line starts here"})
    lines = EventFormatter().lines(short, fold([*before, short]))
    assert lines[0].splitlines()[1:] == ["point 2 ends with 2 records: no safe straight line starts here"]


def test_a_closed_set_is_summarized_in_one_line_and_that_of_the_identification_with_the_forecast():
    history = closed(HELD_OUT)
    lines = EventFormatter().lines(history[-1], fold(history))
    assert lines == ["held-out point 1, before  2 records, largest deviation 1.250 mm, drift 0.020 mm"]
    formatter = EventFormatter()
    history = [move(POINT, 7, FORECAST), *closed(POINT)]
    lines = [line for event in history for line in formatter.lines(event, fold(history))]
    assert [line.split(",")[0].split(";")[0] for line in lines] == [
        "point 2                   2 records",
        "  predicted error at the task 0.290 mm",
    ]


def test_the_text_of_each_event():
    failed = events.Failed(
        step=None, failure=FailureKind.LINK_LOST, attempt=2, reason="x is silent", action=Action.RETRY
    )
    left_out = events.RecordRejected(at=POINT, orientation=3, reason="out of travel")
    texts: list[tuple[Any, str | None]] = [
        (events.SetInvalidated(at=POINT, reason="drift"), "point 2 is measured again: drift"),
        (left_out, "point 2, orientation 3 left out: out of travel"),
        (events.RecordDiscarded(at=POINT, orientation=3), "point 2, orientation 3 is measured again"),
        (
            events.ReferenceConfirmed(at=POINT, change_mm=ZERO, reading=READING),
            "point 2 continues: its reference is unchanged",
        ),
        (events.Committed(approved_by="a rule"), "written to the controller, approved by a rule"),
        (events.CommandRejected(command="undo", reason="no record"), "undo: no record"),
        (events.Paused(), "paused"),
        (failed, "x is silent\n  attempt 2: retry"),
        (events.Located(pose=POSE, joints=None, encoders=POSE), None),
    ]
    assert [event_text(event, RunState()) for event, _ in texts] == [text for _, text in texts]
