"""The words of the screens: gauges that are being placed, questions, guidance, faults, records."""

from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from drivers.interfaces import EncoderSample
from hexacell.campaign.decisions import Forecast
from hexacell.campaign.time_model import TimeModel
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.recovery import Action, FailureKind
from hexacell.kinematics.pose import Pose
from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot, Shown
from hexacell.run_process.messages import (
    ControlChanged,
    EventRecorded,
    HostFailed,
    HostMessage,
    QuestionChanged,
    RunDescribed,
    StatusChanged,
)
from hexacell.text.screens.banner import ONCE_MENDED, cell_banner, preflight_banner, run_banner
from hexacell.text.screens.devices import device_cards, gauge_lines
from hexacell.text.screens.measuring import fault_view, record_rows, remaining
from hexacell.text.screens.placing import mounting_advice, placing
from hexacell.text.screens.reviewing import review_lines
from hexacell.text.screens.run_picture import RunPicture, Setback, header_line, picture_after
from hexacell.text.screens.views import ChecklistItem, Mark, Urgency
from hexacell.verdict.decision import Verdict
from procedures.engine.command_loop import Status
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
        ({"shown_mm": -1.2}, "move it 1.2 mm in, along -x"),
        ({"shown_mm": 1.2}, "move it 1.2 mm out, along +x"),
        ({"shown_mm": 1.2, "sign": -1}, "move it 1.2 mm out, along -x"),
        ({"shown_mm": -1.2, "sign": -1}, "move it 1.2 mm in, along +x"),
        ({"shown_mm": 3.4, "middle_mm": 3.0}, "in place, 0.4 mm from mid travel"),
        ({"middle_mm": None}, "set it to mid travel by eye"),
        ({"shown_mm": None}, "no answer yet"),
        ({"problem": "silent"}, "silent"),
    ]
    assert [mounting_advice(gauge(**changes), 1.0) for changes, _ in moves] == [said for _, said in moves]


@given(signs=st.tuples(*[st.sampled_from([1, -1])] * 3), shown=st.tuples(*[st.floats(-6.0, 6.0)] * 3))
def test_gauges_are_drawn_on_their_sides_and_are_in_place_once_all_of_them_are(
    signs: tuple[int, int, int], shown: tuple[float, float, float]
) -> None:
    gauges = tuple(
        gauge(name=axis, axis=axis, sign=sign, shown_mm=mm)
        for axis, sign, mm in zip("xyz", signs, shown, strict=True)
    )
    found = placing(LiveSnapshot(gauges=gauges), 1.0)
    assert found.are_in_place == all(abs(one) <= 1.0 for one in shown)
    rows = ["".join(text for text, _ in row) for row in found.picture]
    assert len({len(row) for row in rows}) == 1
    ball = next((row, line.index("██████")) for row, line in enumerate(rows) if "██████" in line)
    for axis, sign in zip("xyz", signs, strict=True):
        name = f"{'+' if sign > 0 else '-'}{axis}"
        row, column = next((at, line.index(name)) for at, line in enumerate(rows) if name in line)
        is_there = {"x": column > ball[1], "y": row < ball[0], "z": row < ball[0]}[axis]
        assert is_there == (sign > 0)


def test_a_device_that_is_silent_gets_older_by_itself() -> None:
    snapshot = LiveSnapshot(
        gauges=(gauge(),), encoders=Shown(value=EncoderSample((), (0.0,) * 6), age_s=0.1)
    )
    x, encoders, controller, stop = device_cards(snapshot, later_s=7.0)
    assert (x.state, x.figure) == ("ok", "+0.0000 mm")
    assert x.lines[-1].endswith("7.1 s ago")
    assert encoders.lines[-1] == "7.1 s ago"
    assert (controller.state, stop.state) == ("waiting", "free")
    silent = device_cards(LiveSnapshot(gauges=(gauge(problem="gauge x: silent"),), stop_reason="open"), 0.0)
    assert [(one.urgency, one.lines[:1]) for one in (silent[0], silent[-1])] == [
        (Urgency.ALARM, ("silent",)),
        (Urgency.ALARM, ("open",)),
    ]


def test_the_time_that_is_left_follows_from_the_pace_and_from_people() -> None:
    story = Story(POINT)
    told = [recorded(story.sampled(number), number) for number in range(1, 6)]
    picture = pictured(described(expected_records=25), *told)
    assert remaining(picture, None) == "About 10 minutes, at most 20 readings left"
    bundled = load_cell(bundled_config("simulated-hexaglide")).settings
    stations = bundled.stations.model_copy(update={"placement": "by-hand"})
    settings = bundled.model_copy(update={"stations": stations})
    by_hand = TimeModel.of(settings).place_s / 60.0
    visits = len(settings.identification.points) + 2 * len(settings.verification.points)
    assert by_hand > 0.0
    minutes = round(10.0 + (visits - 1) * by_hand)
    assert remaining(picture, settings) == f"About {minutes} minutes, at most 20 readings left"


def test_who_watches_is_told_who_is_in_control() -> None:
    picture = pictured(described(), ControlChanged(is_in_control=False, who="grace"))
    assert run_banner(picture, None).rest == "You only watch; c takes over"
    assert header_line("c", picture)[1] == "watching, grace is in control"
    paused = picture_after(picture, StatusChanged(status=Status.PAUSED), 0.0)
    assert (
        run_banner(paused, None).action == "Press c to take over, then p to go on; the robot stands still"
    )
    ended = picture_after(picture, StatusChanged(status=Status.ENDED), 0.0)
    assert header_line("c", ended)[1] == "over"
    asked = picture_after(
        picture,
        QuestionChanged(question=ask_placement(SetKey(phase=Phase.LENGTH, point=1), Pose(0.0, 0.0, 0.0))),
        0.0,
    )
    banner = run_banner(asked, None)
    assert (banner.word, banner.urgency) == ("WAITING", Urgency.CALM)


def test_a_run_that_cannot_be_resumed_says_so_and_one_that_begins_says_what_comes() -> None:
    banner = run_banner(pictured(described()), None)
    assert "choosing" not in banner.action
    assert banner.following == "Next: the robot goes to the first point"
    refused = HostFailed(problem="c.toml has changed", action="Undo the change", exit_code=2)
    picture = pictured(described(), refused, StatusChanged(status=Status.ENDED))
    assert run_banner(picture, None).action == "Undo the change"


def test_after_a_fail_the_key_of_a_calibration_is_named() -> None:
    for verdict, key in ((Verdict.FAIL, "2 and s calibrate"), (Verdict.PASS, "5 History")):
        judged = events.ResultValidated(verdict=verdict, line="so")
        told = recorded(judged), recorded(events.Ended(exit_code=0, line="so"), 2)
        banner = run_banner(pictured(described(), *told, StatusChanged(status=Status.ENDED)), None)
        assert key in banner.following


def test_a_recorded_run_that_ended_early_says_why() -> None:
    early = recorded(events.Interrupted(reason="it was declined", exit_code=1))
    banner = run_banner(pictured(described(is_recorded=True), early), None)
    assert banner.action == "It ended early: it was declined"
    assert "next" not in banner.following


def test_forecasts_with_records_that_were_discarded_are_not_drawn() -> None:
    story, forecast = Story(POINT), Forecast(now_mm=1.0, next_mm=0.9, end_mm=0.1, records=9, minutes=1.0)
    expected = Expectation(
        deviation_mm=(0.0, 0.0, 0.0), sigma_mm=(1.0, 1.0, 1.0), gain=1.0, forecast=forecast
    )
    moves = [
        recorded(events.StepBegun(step=Move(at=POINT, orientation=2, pose=(0.0,) * 6, expected=expected)))
    ]
    told = [recorded(story.sampled(number)) for number in range(1, 6)]
    picture = pictured(described(), *told[:2], *moves, *told[2:], *moves)
    assert [records for records, _ in picture.forecasts] == [2, 5]
    again = [recorded(events.SetInvalidated(at=POINT, reason="so")), *told[:3], *moves]
    for message in again:
        picture = picture_after(picture, message, 0.0)
    assert [records for records, _ in picture.forecasts] == [2, 3]


def test_a_gauge_without_a_reading_is_not_old() -> None:
    lines = gauge_lines(LiveSnapshot(gauges=(gauge(shown_mm=None, age_s=None), gauge(age_s=7.5))))
    assert "never" not in lines[0][0]
    assert lines[1][0].endswith(", 7.5 s ago")


def test_what_is_to_be_mended_comes_before_everything_else() -> None:
    snapshot = LiveSnapshot(gauges=(gauge(problem="gauge x: silent"),), stop_reason="open")
    banner = cell_banner(snapshot, "")
    assert (banner.action, banner.following) == ("Gauge x: silent", f"1 more below. {ONCE_MENDED}")
    failed = ChecklistItem(Mark.FAILED, "gauge y", "it answers in inch", "Press the in/mm key")
    ready = ChecklistItem(Mark.DONE, "gauge x")
    checked = partial(preflight_banner, is_checked=True, is_checking=False, is_running=False)
    assert checked((ready, failed)).action == "Gauge y: Press the in/mm key"
    assert checked((ready,)).action.startswith("Press s")
    assert checked((failed,), is_checked=False).action.startswith("Press Enter")


def test_a_record_has_what_it_is_off_and_how_many_sigma_that_is_and_far_ones_are_marked() -> None:
    story, pose = Story(POINT), (0.0, 0.0, 500.0, 1.0, 0.0, 0.0)
    expected = Expectation(deviation_mm=(0.1, 0.0, 0.0), sigma_mm=(0.05, 0.1, 0.1), gain=1.0)
    messages: list[HostMessage] = [recorded(story.sampled(1))]
    for orientation, x in ((2, -0.1), (3, -0.11)):
        step = Move(at=POINT, orientation=orientation, pose=pose, expected=expected)
        messages += [
            recorded(events.StepBegun(step=step)),
            recorded(story.sampled(orientation, (x, 0.01, 0.02))),
        ]
    picture = pictured(*messages, recorded(story.sampled(4, (0.0, 0.01, 0.02))))
    assert [(row.cells, row.urgency) for row in record_rows(picture)] == [
        (("2/1", "+0.000", "+0.000", "+0.000", "ref.", ""), Urgency.CALM),
        (("2/2", "-0.100", "+0.010", "+0.020", "-0.200", "4.0"), Urgency.CALM),
        (("2/3", "-0.110", "+0.010", "+0.020", "-0.210", "4.2 !"), Urgency.ATTENTION),
        (("2/4", "+0.000", "+0.010", "+0.020", "", ""), Urgency.CALM),
    ]


def test_going_back_in_a_recorded_run_forgets_what_came_later() -> None:
    told: list[HostMessage] = [described(is_recorded=True), recorded(Story(POINT).sampled(1))]
    assert record_rows(pictured(*told)) != ()
    assert record_rows(pictured(*told, described(is_recorded=True))) == ()


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
                "Nothing: discard this point and measure it again is under way (attempt 2).",
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
        said, consequences, scope = review_lines(pictured(described(), recorded(judged)))
        assert said[0].lower().startswith(f"{verdict.value}: ")
        assert consequences[0][0].startswith("Approving is not possible yet")
        assert scope == [("what came of it", Urgency.CALM)]
