"""Text for a person at a plain terminal who asks during a run: where it is, and what the gauges show."""

from __future__ import annotations

from hexacell.campaign.decisions import Forecast
from hexacell.run_process.messages import GaugeSnapshot, LiveSnapshot
from hexacell.text.layout import duration, wrapped
from procedures.run.state import RunState
from procedures.steps import events

LETTERS = (
    "Letters, each with Enter: p pause after this record, P at once, r resume,\n"
    "u undo the last record, m measure this point again (m 3: its record 3),\n"
    "g what the gauges show, s where the run is, a abort."
)


def run_status_text(
    doing: str | None,
    state: RunState,
    expected: int,
    last: events.RecordTaken | None,
    forecast: Forecast | None,
) -> str:
    """Where a run is: what it does, how far it is, its last record, its accuracy and the time left."""
    lines = [
        f"Now: {doing or 'connecting'}",
        f"Done: {state.completed} of {max(expected, state.completed)} records and closings of points",
        *([] if last is None else [f"Last record: {record_text(last)}"]),
        *([] if forecast is None else [_forecast_text(forecast)]),
    ]
    return "\n".join(wrapped(line, indent=2) for line in lines)


def record_text(record: events.RecordTaken) -> str:
    """A record in a line: where, and how far the ball was from the point's reference."""
    x, y, z = record.deviation_mm
    where = f"{record.at.name}, orientation {record.orientation}"
    return f"{where}: x {x:+.3f}, y {y:+.3f}, z {z:+.3f} mm"


def gauges_text(snapshot: LiveSnapshot) -> str:
    """What the devices show now, a line each."""
    lines = [_gauge_text(gauge) for gauge in snapshot.gauges]
    if snapshot.encoders.positions is not None:
        positions = " ".join(f"{position:.3f}" for position in snapshot.encoders.positions)
        lines.append(f"encoders: {positions} {snapshot.encoders.unit}")
    if snapshot.stop_reason:
        lines.append(f"motion is forbidden: {snapshot.stop_reason}")
    return "\n".join(wrapped(line, indent=2) for line in lines)


def _gauge_text(gauge: GaugeSnapshot) -> str:
    if gauge.problem:
        return gauge.problem
    if gauge.shown_mm is None or gauge.age_s is None:
        return f"gauge {gauge.name}: not read yet"
    noise = "" if gauge.noise_mm is None else f", noise {1000.0 * gauge.noise_mm:.1f} um"
    shown = f"gauge {gauge.name}: {gauge.shown_mm:+.3f} {gauge.unit}, {gauge.age_s:.1f} s ago{noise}"
    if gauge.middle_mm is None:
        return shown
    beside = gauge.shown_mm - gauge.middle_mm
    return f"{shown}; {beside:+.2f} from mid travel ({gauge.travel_mm:g} {gauge.unit})"


def _forecast_text(forecast: Forecast) -> str:
    left = f", {duration(forecast.minutes)} left" if forecast.minutes > 0.0 else ""
    return (
        f"Predicted error at the task: {forecast.now_mm:.3f} mm now, {forecast.end_mm:.3f} at the end{left}"
    )
