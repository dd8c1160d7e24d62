"""Text for a run: events, lines at a plain terminal, how to resume."""

import shlex
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from drivers.interfaces import EncoderSample
from hexacell.campaign.decisions import Forecast
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.recovery import Action, FailureKind
from hexacell.cli.arguments import make_parser
from hexacell.cli.commands.run import closing_lines, resume_command, run_document
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.run_process.messages import GaugeSnapshot, LiveSnapshot, Shown
from hexacell.runs.run_folder import RunFolder
from hexacell.services.run.calibration_run import RunRequest
from hexacell.text.line_face import EventFormatter, activity, event_text, gauges_text, run_story, story_text
from hexacell.text.verdict import teaching_line, teaching_sentence
from procedures.calibration.calibration import Mode
from procedures.engine.commands import UnattendedOperator
from procedures.journal.journal import Entry
from procedures.run.keys import Phase, SetKey
from procedures.run.readings import Reading
from procedures.run.state import RunState, fold
from procedures.steps import events
from procedures.steps.move import Expectation, Move
from tests.procedures.story import Story

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


def test_what_the_devices_show() -> None:
    snapshot = LiveSnapshot(
        gauges=(
            GaugeSnapshot(
                name="x",
                axis="x",
                shown_mm=1.25,
                age_s=0.24,
                noise_mm=0.0004,
                travel_mm=12.5,
                middle_mm=1.0,
            ),
            GaugeSnapshot(name="y", axis="y", shown_mm=-0.5, age_s=12.0, travel_mm=12.5),
            GaugeSnapshot(name="z", axis="z", travel_mm=12.5),
            GaugeSnapshot(
                name="w", axis="z", shown_mm=1.0, age_s=3.0, problem="gauge w: is silent", travel_mm=1
            ),
        ),
        encoders=Shown(value=EncoderSample((), (1.0, -2.0, 3.5, 4.0, 5.0, 6.0)), age_s=0.0),
        stop_reason="the stop file is there",
    )
    text = gauges_text(snapshot)
    assert text.splitlines() == [
        "gauge x: +1.250 mm, 0.2 s ago, noise 0.4 um; +0.25 from mid travel (12.5 mm)",
        "gauge y: -0.500 mm, 12.0 s ago",
        "gauge z: not read yet",
        "gauge w: is silent",
        "encoders: 1.000 -2.000 3.500 4.000 5.000 6.000 mm",
        "motion is forbidden: the stop file is there",
    ]
    assert max(map(len, text.splitlines())) <= 80


NOON = datetime(2026, 11, 20, 12, 0, tzinfo=UTC)
HISTORY = [
    *Story(SetKey(phase=Phase.AFTER, point=10)).whole(11),
    events.Interrupted(reason="a cable of the third encoder broke", exit_code=3),
    events.Resumed(),
    events.Ended(exit_code=0, line="35 parameters, 55 records at 5 points; " + "position error " * 8),
]
ENTRIES = [
    Entry(n, NOON + timedelta(seconds=n), float(n), event) for n, event in enumerate(HISTORY, start=1)
]


def test_each_record_and_each_turn_has_its_time() -> None:
    told = list(run_story(ENTRIES))
    kinds = [entry.event.kind for entry, _ in told]
    assert kinds == ["sampled"] * 11 + ["closed", "interrupted", "resumed", "ended"]
    lines = story_text(ENTRIES).splitlines()
    assert lines[0] == "12:00:03  held-out point 10, after, orientation 1: x +0.000, y +0.000, z +0.000"
    assert lines[1] == "            mm"
    assert "12:00:26  interrupted: a cable of the third encoder broke" in lines
    assert max(map(len, lines)) <= 80


@pytest.fixture
def request_of(tmp_path):
    def make(mode: Mode) -> RunRequest:
        cell = load_cell(bundled_config("simulated-hexaglide"))
        return RunRequest(cell, RunFolder(tmp_path / "a run"), mode, UnattendedOperator())

    return make


@pytest.mark.parametrize("mode", Mode)
def test_the_resume_command_parses_to_the_same_request(request_of, mode):
    request = request_of(mode)
    program, *arguments = shlex.split(resume_command(request))
    options = make_parser().parse_args(arguments)
    assert program == "hexacell"
    assert (options.cell, options.resume) == (request.cell.path, str(request.folder.path))
    assert options.target == ("run.length" if mode is Mode.LENGTH else "run.main")
    named = mode.value if mode in {Mode.CHECK, Mode.QUICK} else None
    assert getattr(options, "mode", None) == named


def test_one_line_before_the_result_says_what_must_be_taught_anew(request_of):
    moved = TaskDisplacement(position_mm=8.25, orientation_deg=3.0, poses=6, is_within_limits=False)
    ended = events.Ended(exit_code=0, line="all well", displacement=moved)
    request = request_of(Mode.OPTIMISE)
    where, teaching, line = closing_lines(request, ended)
    assert where.endswith(str(request.folder.path))
    assert (teaching, line) == (teaching_line(moved), "all well")
    document = run_document(request, ended, RunState())
    assert document["displacement"] == moved
    assert document["teaching"] == teaching_sentence(moved)
    untouched = run_document(request, events.Ended(exit_code=0, line="all well"), RunState())
    assert untouched["displacement"] is untouched["teaching"] is untouched["measured_noise"] is None
