"""Text for plans: what to measure next, what records gain, what a dry run of each mode predicts."""

from collections.abc import Iterator, Sequence

from drivers.interfaces import DeviceIdentity
from hexacell.campaign.decisions import Finished, Forecast, MeasurePose, StartPoint
from hexacell.campaign.feasibility import records_for
from hexacell.checks.quick_level import QuickAccuracy
from hexacell.dry_run.campaign import DryRunResult, QuickTrial
from hexacell.dry_run.verdict_forecast import NOISE, WANTED, VerdictForecast
from hexacell.lengths import rounded_up, shown, unit_of
from hexacell.measurements.records import RecordId
from hexacell.services.offline import PlanTrial
from hexacell.text.layout import duration
from hexacell.text.measured_noise import averaging_lines
from hexacell.text.time_spent import spent_text
from hexacell.uncertainty.statement import COVERAGE_FACTOR
from hexacell.verdict.decision import Verdict

TRYING_PLAN = "Trying the plan on simulated robots within the tolerances, some seconds ..."


MOST_NAMED = 6
"""Parameters that are named; of more it is said that there are others."""

LEAST_LOST = 0.5
"""Minutes that slow moves take which are worth telling."""

SHOWN_BUDGETS = 4
"""For so many shorter durations it is told what they would give."""


def decision_text(decision: StartPoint | MeasurePose | Finished) -> str:
    """The decision what to do now, as a sentence."""
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
    now = f"Predicted error at the worst task pose {shown(forecast.now_mm)} (one sigma)"
    now += _expanded(forecast, forecast.now_mm, " with the systematic effects")
    if not forecast.records:
        return f"{now}."
    then = _expanded(forecast, forecast.end_mm, " then")
    return (
        f"{now}; continuing gains {shown(forecast.gain_mm)}{then} in {forecast.records} records, about "
        f"{duration(forecast.minutes)}."
    )


def _expanded(forecast: Forecast, error_mm: float, when: str = "") -> str:
    """U for one of the predicted errors, with its unit and ``when``; empty where it is not known."""
    expanded = forecast.expanded_mm(error_mm)
    return "" if expanded is None else f", U {shown(expanded)}{when}"


def left_out_text(records: Sequence[RecordId]) -> str:
    """The records that were left out; empty without any."""
    if not records:
        return ""
    named = "; ".join(f"point {point}, orientation {orientation}" for point, orientation in records)
    return f"Left out, as the other records contradict them: {named}. hexacell fit says why."


def run_forecast_line(forecast: Forecast) -> str:
    """The predicted error after the record that was forecast, and at the end, each with its U."""
    unit = unit_of(forecast.end_mm)

    def with_u(error_mm: float, size: str) -> str:
        expanded = forecast.expanded_mm(error_mm)
        return size if expanded is None else f"{size}, U {unit.number(expanded)}"

    line = f"  predicted error at the task {with_u(forecast.next_mm, unit.length(forecast.next_mm))}"
    left = forecast.records - 1
    if left < 1:
        return line
    minutes = duration(forecast.minutes * left / forecast.records)
    return f"{line}; in {minutes} {with_u(forecast.end_mm, unit.number(forecast.end_mm))}"


def _unseen_lines(trial: PlanTrial) -> Iterator[str]:
    """What no record of this robot shows, and what those of the plan do not determine."""
    if trial.never_seen:
        yield f"No record of this robot shows {trial.never_seen}."
    if names := trial.result.undetermined:
        shown_names = f"{', '.join(names[:MOST_NAMED])}{' and others' if len(names) > MOST_NAMED else ''}"
        yield f"By the tolerances alone, which U contains: {shown_names}."


def plan_trial_lines(trial: PlanTrial) -> Iterator[str]:
    """The outcome expected of a plan, and for which robots it fails."""
    result, target_mm = trial.result, trial.target_mm
    like = f" (moves and readings as in the run {trial.like})" if trial.like else ""
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
            f"{shown(result.worst_sigma_mm)} at the worst of your task poses (one sigma), in about "
            f"{spent_text(result.seconds)}{like}."
        )
        if result.expanded_mm is not None:
            yield (
                f"The expanded uncertainty U of the largest error there will be about "
                f"{shown(result.expanded_mm)}, with the systematic effects of [uncertainty]."
            )
        yield from _unseen_lines(trial)
        yield from _course_lines(result)
        if trial.lost_to_speed >= LEAST_LOST:
            saved = duration(trial.lost_to_speed)
            yield f"Twice the speeds with gauges at the ball ([speed]) would take {saved} less."
        if result.verdicts is not None:
            yield from verdict_forecast_lines(result.verdicts, result.records)
        yield from averaging_lines(trial.averaging, trial.encoders_part_mm)
        expanded_mm = result.expanded_mm or COVERAGE_FACTOR * result.worst_sigma_mm
        if target_mm is not None and expanded_mm > target_mm:
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


def _course_lines(result: DryRunResult) -> Iterator[str]:
    """What fewer minutes would give, at a few of them."""
    if len(result.course) < SHOWN_BUDGETS:
        return
    first, last = int(result.course[0][0]) + 1, int(result.minutes)
    step = max(1, round((last - first) / SHOWN_BUDGETS))
    told = [
        f"{limit} minutes {shown([size for minutes, size in result.course if minutes <= limit][-1])}"
        for limit in range(first, last + 1, step)
    ]
    name = "the error" if result.expanded_mm is None else "U"
    if told:
        yield f"Sooner ([identification] budget_minutes) {name} would be larger: {', '.join(told)}."


def device_line(identity: DeviceIdentity) -> str:
    """Which device answered, with its protocol and serial number, where it is, and what is to be known."""
    serial = f", serial number {identity.serial_number}" if identity.serial_number else ""
    words = (identity.description, identity.settings, identity.port, identity.remark)
    return f"{identity.name}, {identity.protocol}{serial}: {'; '.join(word for word in words if word)}"


def preflight_lines(devices: Sequence[DeviceIdentity]) -> Iterator[str]:
    """The checks that passed, before the plan is tried on simulated robots."""
    for identity in devices:
        yield f"ok  {device_line(identity)}"
    yield "ok  all points can be reached, all devices answer; nothing was moved"
    yield TRYING_PLAN


def verdict_forecast_lines(forecast: VerdictForecast, records: int) -> Iterator[str]:
    """How likely a healthy machine passes by some records; if it is not, why, and what would help."""
    others = ", ".join(
        f"{verdict} {_percent(share)}"
        for verdict, share in forecast.probabilities.items()
        if verdict is not Verdict.PASS and share >= 0.005
    )
    rest = f" ({others})" if others else ""
    yield (
        f"A healthy machine of this cell passes with a probability of "
        f"{_percent(forecast.probabilities[Verdict.PASS])}{rest}."
    )
    if not forecast.is_wanted:
        yield _warning(forecast, records)


def _warning(forecast: VerdictForecast, records: int) -> str:
    """The limits that are too small with values that would do, and what would help."""
    wanted, present = forecast.passing, forecast.limits
    limits = []
    if wanted.position_mm > present.position_mm:
        limits.append(f"position_mm = {rounded_up(wanted.position_mm):g}")
    if wanted.orientation_deg > present.orientation_deg:
        limits.append(f"orientation_deg = {rounded_up(wanted.orientation_deg):g}")
    unit = unit_of(forecast.standard_mm)
    sizes = f"{unit.number(forecast.largest_part_mm)} of {unit.length(forecast.standard_mm)}"
    part = f"{forecast.largest_part} ({sizes})"
    remedy = "have it calibrated, or measure it, and state its size in [uncertainty]"
    if forecast.largest_part == NOISE:
        noise, whole = forecast.largest_part_mm, forecast.standard_mm
        allowed = whole * min(1.0, present.position_mm / wanted.position_mm)
        needed = records_for(allowed, records, noise, max(whole**2 - noise**2, 0.0) ** 0.5)
        some = f"about {needed}" if needed and needed > records else "more"
        remedy = f"{some} records instead of {records}, or means of more readings, reduce it so far"
    return (
        f"That is too little: a good machine fails these limits. {WANTED:.0%} would pass "
        f"{' and '.join(limits) or 'the limits'} in [acceptance]. The largest part of the uncertainty at "
        f"the worst task pose is the {part}: {remedy}."
    )


def _percent(share: float) -> str:
    return f"{share:.0%}" if share < 0.995 else f"{share:.1%}"


def quick_accuracy_sentences(found: QuickAccuracy) -> str:
    """How well the robot is known after a quick level, and what more records would give."""
    unit = unit_of(found.error_mm, found.calibrated_mm)
    further = ", ".join(f"{one.records} more {unit.number(one.error_mm)}" for one in found.further)
    return (
        f"{found.records} records leave {unit.length(found.error_mm)} at the worst task pose (one sigma), "
        f"{found.ratio:.2g} times the {unit.number(found.calibrated_mm)} that the last calibration left. "
        f"{_to_calibrated(found)} Of more records ([quick] budget_records), {further} would be left."
    )


def _to_calibrated(found: QuickAccuracy) -> str:
    match found.records_to_calibrated:
        case None:
            return "No sensible number of records would leave as little; a calibration would."
        case 0:
            return "That is as little."
        case more:
            return f"About {more} more would leave as little."


def quick_trial_text(trial: QuickTrial) -> str:
    """The outcome expected of the quick level."""
    if trial.accuracy is None:
        return "No simulated robot that drifted as stated could be measured: a quick level may fail."
    return (
        f"{trial.accuracy.records} records at {trial.points} points, in about {duration(trial.minutes)}, "
        "and then the held-out poses as after a calibration. Expected of a robot that drifted as "
        f"drift_per_parameter_mm in [check] states: {quick_accuracy_sentences(trial.accuracy)}"
    )
