"""Text for the verification of a result: verdict, errors at the task poses, and evidence."""

from __future__ import annotations

from pathlib import Path

from hexacell.checks.change_alarm import ChangeAlarm
from hexacell.checks.check_result import CheckResult
from hexacell.results.result import AcceptedResult
from hexacell.text.layout import wrapped
from hexacell.text.length import earlier_scale_line, scale_lines
from hexacell.verdict.decision import Verdict
from hexacell.verdict.verification import JudgedError, Verification, VerifiedAccuracy


def verification_text(verified: Verification) -> str:
    """A few lines: the verdict with its reason first."""
    lines = [_verdict(verified), *_errors(verified.accuracy), *_comparison(verified)]
    lines += [f"  {wrapped(test.sentence, indent=2)}" for test in verified.tests if not test.passed]
    if verified.accuracy is not None:
        lines += [f"  {line}" for line in scale_lines(verified.accuracy.length, verified.accuracy.scale_of)]
    return "\n".join(lines)


def _verdict(verified: Verification) -> str:
    """With the evidence, where all of it is for the model."""
    if not verified.tests or not all(test.passed for test in verified.tests):
        return f"verdict: {verified.verdict}"
    return f"verdict: {verified.verdict}; the model agrees with the records in {len(verified.tests)} tests"


def check_text(found: CheckResult) -> str:
    """The same for a check: the verdict, the error now, and what has changed."""
    lines = [f"verdict: {found.verdict}", *_errors(found.accuracy), *_drift(found)]
    if found.alarm is not None and found.alarm.is_raised:
        lines.append(wrapped(f"  {alarm_sentence(found.alarm)}", indent=2))
    if not found.is_consistent:
        lines.append("  the residuals are larger than the stated noise explains: the model does not hold")
    if found.accuracy is not None:
        lines.append(f"  {earlier_scale_line(found.accuracy.length, found.accuracy.scale_of)}")
    return "\n".join(lines)


def alarm_sentence(alarm: ChangeAlarm) -> str:
    """What an alarm says, and what to do."""
    size = f"{alarm.change:+.3f} +- {alarm.sigma:.3f} {alarm.unit}"
    return (
        f"alarm: the first {alarm.records} records contradict an unchanged machine (score "
        f"{alarm.score:.1f}, by chance {alarm.limit:.1f} in one check of 100). If one part changed, it is "
        f"of leg {alarm.leg}, as by {size} of {alarm.parameter}. Repeat the check: this is no verdict"
    )


def check_start_text(accepted: AcceptedResult | None) -> str:
    """What a check starts from."""
    if accepted is None:
        return "no accepted result has the controller's config: the check starts from the drawing"
    return f"the check starts from the result of {accepted.at:%Y-%m-%d}, {Path(accepted.run).name}"


def _drift(found: CheckResult) -> list[str]:
    """The parameter that has changed most, if that is significant."""
    if found.earlier_at is None or not found.changes:
        return []
    most, since = found.significant_change, f"{found.earlier_at:%Y-%m-%d}"
    if most is not None:
        change = f"{most.name} by {most.change:+.3f} {most.unit} (sigma {most.sigma:.3f})"
        return [f"  changed most since {since}: {change}"]
    unchanged = f"  no parameter has changed significantly since {since}"
    return [unchanged] if found.verdict is Verdict.PASS else []


def _errors(accuracy: VerifiedAccuracy | None) -> list[str]:
    if accuracy is None:
        return []
    what = "task poses" if accuracy.task_named else "poses across the workspace"
    return [
        _error(f"largest position error at {accuracy.poses} {what}", accuracy.position, "mm"),
        _error("largest orientation error there", accuracy.orientation, "deg"),
        *_guard_band(accuracy),
    ]


def _error(what: str, error: JudgedError, unit: str) -> str:
    """U is the expanded uncertainty."""
    stated = f"{error.value:.3f} {unit}, U {error.expanded:.3f} (limit {error.limit:g})"
    return f"  {what}: {stated}"


def _guard_band(accuracy: VerifiedAccuracy) -> list[str]:
    """What a verdict keeps from the limits, where value and U do not tell why it is no pass."""
    told = [error for error in (accuracy.position, accuracy.orientation) if error.guard_band]
    return [f"  a pass and a fail keep {told[0].guard_band} from the limit"] if told else []


def _comparison(verified: Verification) -> list[str]:
    if verified.before_mm is None or verified.after_mm is None:
        return []
    means = f"{verified.before_mm:.2f} -> {verified.after_mm:.3f} mm"
    worse = ", significantly worse" if verified.is_worse else ""
    return [f"  mean deviation at held-out poses {means}{worse}"]
