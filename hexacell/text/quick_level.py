"""Text for the quick level and for checks: what they start from, what they give, and what more would."""

from __future__ import annotations

from pathlib import Path

from hexacell.checks.quick_level import QuickAccuracy
from hexacell.dry_run.check import CheckTrial
from hexacell.dry_run.quick_level import QuickTrial
from hexacell.results.result import AcceptedResult
from hexacell.text.layout import duration, wrapped


def quick_start_text(accepted: AcceptedResult | None) -> str | None:
    """What a quick level starts from."""
    if accepted is None:
        return None
    return f"the quick level starts from the result of {accepted.at:%Y-%m-%d}, {Path(accepted.run).name}"


def quick_accuracy_text(found: QuickAccuracy) -> str:
    """How well the robot is known by it, and what more records would give, in lines."""
    return wrapped(f"quick level: {quick_accuracy_sentences(found)}", indent=2)


def quick_accuracy_sentences(found: QuickAccuracy) -> str:
    """The same as sentences."""
    further = ", ".join(f"{one.records} more {one.error_mm:.3f}" for one in found.further)
    return (
        f"{found.records} records leave {found.error_mm:.3f} mm at the worst task pose (one sigma), "
        f"{found.ratio:.2g} times the {found.calibrated_mm:.3f} that the last calibration left. "
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
    """What the quick level is expected to give."""
    if trial.accuracy is None:
        return "No simulated robot that drifted as stated could be measured: a quick level may fail."
    return (
        f"{trial.accuracy.records} records at {trial.points} points, in about {duration(trial.minutes)}, "
        "and then the held-out poses as after a calibration. Expected of a robot that drifted as "
        f"drift_per_parameter_mm in [check] states: {quick_accuracy_sentences(trial.accuracy)}"
    )


def check_trial_text(trial: CheckTrial) -> str:
    """What a check is expected to take and to give."""
    if not trial.records:
        return "No simulated robot that drifted as stated could be measured: a check may fail."
    error = (
        "" if trial.error_mm is None else f"; {trial.error_mm:.3f} mm at the worst task pose (one sigma)"
    )
    measured = f"{trial.records} records at {trial.points} points"
    return (
        f"A check: {measured}, in about {duration(trial.minutes)}{error}. That is of a robot "
        "that drifted as drift_per_parameter_mm in [check] states; it takes more where the error is "
        "near the limit."
    )
