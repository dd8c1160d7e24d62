"""The words of the screens: gauges that are being placed, questions, guidance, faults, records."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

from drivers.interfaces import EncoderSample
from hexacell.cell.recovery import Action, FailureKind
from hexacell.kinematics.pose import Pose
from hexacell.run_process.messages import (
    ControlChanged,
    EventRecorded,
    GaugeSnapshot,
    HostFailed,
    HostMessage,
    LiveSnapshot,
    QuestionChanged,
    RunDescribed,
    Shown,
)
from hexacell.text.screens.live import device_lines, mounting_advice
from hexacell.text.screens.measuring import fault_view, guidance, record_lines
from hexacell.text.screens.reviewing import review_texts
from hexacell.text.screens.run_picture import RunPicture, Setback, picture_after
from hexacell.verdict.decision import Verdict
from procedures.run.keys import Phase, SetKey
from procedures.run.questions import ask_placement
from procedures.run.trips import Guard
from procedures.steps import events
from procedures.steps.move import Expectation, Move
from tests.procedures.story import Story

POINT = SetKey(phase=Phase.IDENTIFY, point=2)


def gauge(**changes: object) -> GaugeSnapshot:
    known = {"name": "x", "axis": "x", "shown_mm": 0.0, "travel_mm": 12.5, "middle_mm": 0.0, "age_s": 0.1}
    return GaugeSnapshot.model_validate(known | changes)


def pictured(*messages: HostMessage) -> RunPicture:
    picture = RunPicture()
    for message in messages:
        picture = picture_after(picture, message, 0.0)
    return picture


def described(**changes: object) -> RunDescribed:
    known = {"cell": "c", "cell_file": Path("c.toml"), "folder": Path("r"), "mode": "optimise"}
    return RunDescribed.model_validate(known | changes)


def recorded(event: events.Event, number: int = 1) -> EventRecorded:
    at = datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=30 * number)
    return EventRecorded(sequence=number, at=at, event=event)


def test_a_gauge_says_how_it_is_to_be_moved() -> None:
    moves: list[tuple[dict[str, object], str]] = [
        ({"shown_mm": -1.2}, "move the x gauge 1.2 mm in (along -x)"),
        ({"shown_mm": 1.2}, "move the x gauge 1.2 mm out (along +x)"),
        ({"shown_mm": 1.2, "sign": -1}, "move the x gauge 1.2 mm out (along -x)"),
        ({"shown_mm": -1.2, "sign": -1}, "move the x gauge 1.2 mm in (along +x)"),
        ({"shown_mm": 3.4, "middle_mm": 3.0}, "ok, 0.4 mm from mid travel"),
        ({"middle_mm": None}, "set the x plunger to mid travel by eye"),
        ({"shown_mm": None}, "the x gauge does not answer"),
        ({"problem": "silent"}, "the x gauge does not answer"),
    ]
    assert [mounting_advice(gauge(**changes), 1.0) for changes, _ in moves] == [said for _, said in moves]


def test_a_device_that_is_silent_gets_older_by_itself() -> None:
    snapshot = LiveSnapshot(
        gauges=(gauge(),), encoders=Shown(value=EncoderSample((), (0.0,) * 6), age_s=0.1)
    )
    assert "0.1 s" in device_lines(snapshot)[0][0]
    lines = device_lines(snapshot, later_s=7.0)
    assert "7.1 s" in lines[0][0]
    assert lines[1][0].endswith("mm, 7.1 s ago")


def test_the_time_that_is_left_follows_from_the_pace() -> None:
    story = Story(POINT)
    told = [recorded(story.sampled(number), number) for number in range(1, 6)]
    picture = pictured(described(expected_records=25), *told)
    assert guidance(picture, None)["Time"] == "about 10 minutes: at most 20 of 25 readings are left"


def test_who_watches_is_told_who_is_in_control() -> None:
    picture = pictured(described(), ControlChanged(is_in_control=False, who="grace"))
    assert guidance(picture, None)["Stop"] == "you only watch: grace is in control; c takes over"
    asked = picture_after(
        picture,
        QuestionChanged(question=ask_placement(SetKey(phase=Phase.LENGTH, point=1), Pose(0.0, 0.0, 0.0))),
        0.0,
    )
    assert guidance(asked, None)["Now"] == "a question waits for who is in control"


def test_a_record_has_its_largest_residual_and_how_many_sigma_that_is() -> None:
    story, pose = Story(POINT), (0.0, 0.0, 500.0, 1.0, 0.0, 0.0)
    expected = Expectation(deviation_mm=(0.1, 0.0, 0.0), sigma_mm=(0.05, 0.1, 0.1), gain=1.0)
    step = Move(at=POINT, orientation=2, pose=pose, expected=expected)
    picture = pictured(
        recorded(story.sampled(1)),
        recorded(events.StepBegun(step=step)),
        recorded(story.sampled(2, (-0.1, 0.01, 0.02))),
        recorded(story.sampled(3, (0.0, 0.01, 0.02))),
    )
    assert record_lines(picture) == (
        "2/1           +0.000  +0.000  +0.000      reference",
        "2/2           -0.100  +0.010  +0.020   -0.200   4.0",
        "2/3           +0.000  +0.010  +0.020        -     -",
    )


def test_going_back_in_a_recorded_run_forgets_what_came_later() -> None:
    told: list[HostMessage] = [described(is_recorded=True), recorded(Story(POINT).sampled(1))]
    assert record_lines(pictured(*told)) != ()
    assert record_lines(pictured(*told, described(is_recorded=True))) == ()


def test_a_fault_has_its_cause_and_the_next_action() -> None:
    setbacks: list[tuple[Setback, str, str]] = [
        *(
            (
                events.Tripped(guard=guard, device="gauge y", problem="why", action="Mend it"),
                f"Stopped by a guard: {guard.value}",
                "Mend it",
            )
            for guard in Guard
        ),
        *(
            (
                events.Failed(step=None, failure=kind, attempt=2, reason="why", action=Action.REDO_SET),
                "A step failed, the robot was stopped",
                "The run does this now: redo-set (attempt 2).",
            )
            for kind in FailureKind
        ),
        (HostFailed(problem="why", action="Wait", exit_code=5), "The run could not go on", "Wait"),
    ]
    for setback, title, action in setbacks:
        view = fault_view(setback)
        assert (view.title, view.action) == (title, action)
        assert view.cause.endswith("why")


def test_every_verdict_is_said_in_words_with_its_scope() -> None:
    for verdict in Verdict:
        judged = events.ResultValidated(verdict=verdict, line="what came of it")
        shown = review_texts(pictured(described(), recorded(judged)), None)
        assert shown["verdict"].lower().startswith(f"{verdict.value}: ")
        assert shown["scope"] == "what came of it"
