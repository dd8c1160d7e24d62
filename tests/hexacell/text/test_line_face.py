"""Text at a plain terminal: what the devices show, a recorded run told in lines."""

from datetime import UTC, datetime, timedelta

from hexacell.run_process.messages import EncoderSnapshot, GaugeSnapshot, LiveSnapshot
from hexacell.text.line_face import gauges_text, run_story, story_text
from procedures.journal.journal import Entry
from procedures.run.keys import Phase, SetKey
from procedures.steps import events
from tests.procedures.story import Story


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
        encoders=EncoderSnapshot(positions=(1.0, -2.0, 3.5, 4.0, 5.0, 6.0), age_s=0.0),
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
