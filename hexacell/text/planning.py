"""Text for the plan: the devices it needs, what to measure next, and what the remaining records gain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from drivers.interfaces import DeviceIdentity
from hexacell.campaign.decisions import Finished, Forecast, MeasurePose, StartPoint
from hexacell.measurements.records import RecordId
from hexacell.services.records.offline import PlanTrial
from hexacell.text.layout import duration
from hexacell.text.measured_noise import averaging_lines
from hexacell.text.verdict_forecast import verdict_forecast_lines

TRYING_PLAN = "Trying the plan on simulated robots within the tolerances, some seconds ..."


def decision_text(decision: StartPoint | MeasurePose | Finished) -> str:
    """What to do now."""
    match decision:
        case Finished(reason=reason):
            return f"Done: {reason}."
        case StartPoint(point=point, pose=pose):
            return f"Begin point {point}: go to {pose}, put the gauges around the ball and zero them."
        case MeasurePose():
            expected = ", ".join(
                f"{axis} {value:+.3f} +- {sigma:.3f}"
                for axis, value, sigma in zip("xyz", decision.deviation, decision.sigma, strict=True)
            )
            waypoints = "".join(f"pass through {pose}, " for pose in decision.via)
            return (
                f"Point {decision.point}, orientation {decision.orientation}: {waypoints}"
                f"go to {decision.pose}. The gauges should show {expected} mm (one sigma)."
            )


def forecast_text(forecast: Forecast | None) -> str:
    """The predicted error now, and what the remaining records gain."""
    if forecast is None:
        return "The robot can take none of the task poses, so no accuracy is predicted."
    now = f"Predicted error at the worst task pose {forecast.now_mm:.3f} mm (one sigma)"
    now += _expanded(forecast, forecast.now_mm, " mm with the systematic effects")
    if not forecast.records:
        return f"{now}."
    then = _expanded(forecast, forecast.end_mm, " mm then")
    return (
        f"{now}; continuing gains {forecast.gain_mm:.3f} mm{then} in {forecast.records} records, about "
        f"{duration(forecast.minutes)}."
    )


def _expanded(forecast: Forecast, error_mm: float, unit: str = "") -> str:
    """U for one of the predicted errors; empty where it is not known."""
    expanded = forecast.expanded_mm(error_mm)
    return "" if expanded is None else f", U {expanded:.3f}{unit}"


def left_out_text(records: Sequence[RecordId]) -> str:
    """The records that were left out; empty without any."""
    if not records:
        return ""
    named = "; ".join(f"point {point}, orientation {orientation}" for point, orientation in records)
    return f"Left out, as the other records contradict them: {named}. hexacell fit says why."


def run_forecast_line(forecast: Forecast) -> str:
    """The predicted error after the record that was forecast, and at the end, each with its U."""
    now = f"{forecast.next_mm:.3f} mm{_expanded(forecast, forecast.next_mm)}"
    line = f"  predicted error at the task {now}"
    left = forecast.records - 1
    if left < 1:
        return line
    minutes = duration(forecast.minutes * left / forecast.records)
    return f"{line}; in {minutes} {forecast.end_mm:.3f}{_expanded(forecast, forecast.end_mm)}"


def plan_trial_lines(trial: PlanTrial) -> Iterator[str]:
    """What a plan is expected to give, and for which robots it fails."""
    result, target_mm = trial.result, trial.target_mm
    if not result.robots:
        yield (
            f"None of {result.drawn} robots drawn within the tolerances could be calibrated with this "
            "plan: a run may fail."
        )
    elif result.worst_sigma_mm is None:
        yield f"{forecast_text(None)} There will be about {result.records} records."
    else:
        yield (
            f"{result.records} records at {result.points} points will give about "
            f"{result.worst_sigma_mm:.3f} mm at the worst of your task poses (one sigma), in about "
            f"{duration(result.minutes)}."
        )
        if result.expanded_mm is not None:
            yield (
                f"The expanded uncertainty U of the largest error there will be about "
                f"{result.expanded_mm:.3f} mm, with the systematic effects of [uncertainty]."
            )
        if result.verdicts is not None:
            yield from verdict_forecast_lines(result.verdicts)
        yield from averaging_lines(trial.averaging, trial.encoders_part_mm)
        if target_mm is not None and result.worst_sigma_mm > target_mm:
            yield f"That is not the target of {target_mm:g} mm: allow more records, points or tilt."
    if 0 < result.robots < result.drawn:
        failed = result.drawn - result.robots
        yield f"{failed} of {result.drawn} simulated robots could not be calibrated with this plan."
    for point, share in trial.unreachable.items():
        if share > 0.0:
            yield (
                f"Point {point}: {share:.0%} of the robots within the tolerances cannot reach it "
                "within their limits; if yours is one of them, the run leaves it out or stops."
            )


def device_line(identity: DeviceIdentity) -> str:
    """Which device answered, with its protocol and serial number, where it is, and what is to be known."""
    serial = f", serial number {identity.serial_number}" if identity.serial_number else ""
    words = (identity.description, identity.settings, identity.port, identity.remark)
    return f"{identity.name}, {identity.protocol}{serial}: {'; '.join(word for word in words if word)}"


def preflight_lines(devices: Sequence[DeviceIdentity]) -> Iterator[str]:
    """What was checked, before the plan is tried on simulated robots."""
    for identity in devices:
        yield f"ok  {device_line(identity)}"
    yield "ok  all points can be reached, all devices answer; nothing was moved"
    yield TRYING_PLAN
