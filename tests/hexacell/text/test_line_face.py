"""Text at a plain terminal: where the run is and what the devices show, within 80 columns."""

from __future__ import annotations

from hexacell.campaign.decisions import Forecast
from hexacell.run_process.messages import EncoderSnapshot, GaugeSnapshot, LiveSnapshot
from hexacell.text.line_face import gauges_text, record_text, run_status_text
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState
from procedures.steps import events
from tests.procedures.story import Story

RECORD = Story(SetKey(phase=Phase.IDENTIFY, point=2)).sampled(3, (0.1234, -0.5, 2.0))
FORECAST = Forecast(now_mm=0.311, next_mm=0.3, end_mm=0.063, records=10, minutes=12.0)


def test_a_record_in_a_line() -> None:
    assert isinstance(RECORD, events.RecordTaken)
    assert record_text(RECORD) == "point 2, orientation 3: x +0.123, y -0.500, z +2.000 mm"


def test_where_the_run_is() -> None:
    assert isinstance(RECORD, events.RecordTaken)
    text = run_status_text("point 2, orientation 4", RunState(), 61, RECORD, FORECAST)
    assert text.splitlines() == [
        "Now: point 2, orientation 4",
        "Done: 0 of 61 records and closings of points",
        "Last record: point 2, orientation 3: x +0.123, y -0.500, z +2.000 mm",
        "Predicted error at the task: 0.311 mm now, 0.063 at the end, 12 minutes left",
    ]


def test_before_anything_happened() -> None:
    assert run_status_text(None, RunState(), 61, None, None).splitlines() == [
        "Now: connecting",
        "Done: 0 of 61 records and closings of points",
    ]


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
