"""Words for what is decided: verdict, errors with U, evidence, length scale, what must be taught anew."""

from collections.abc import Iterator, Sequence

from hexacell.checks.change_alarm import ChangeAlarm
from hexacell.checks.check_result import CheckResult
from hexacell.kinematics.pose import Pose
from hexacell.lengths import MM, from_to, shown, unit_of
from hexacell.results.result import ExpectedImprovement, LengthResult
from hexacell.results.written_geometry import TaskDisplacement
from hexacell.text.layout import change_with_sigma, counted, wrapped
from hexacell.verdict.decision import JudgedError, Verdict, VerifiedAccuracy
from hexacell.verdict.either_side import EitherSide
from hexacell.verdict.length_check import LengthStatement
from hexacell.verdict.verification import Verification, scale_words

VERDICT_MEANINGS = {
    Verdict.PASS: "The error with its safety margin is within the limit.",
    Verdict.CONDITIONAL_PASS: "The error is within the limit, but not by the safety margin.",
    Verdict.NOT_EVALUATED: "The records do not decide it.",
    Verdict.CONDITIONAL_FAIL: "The error is above the limit, but not by the safety margin.",
    Verdict.FAIL: "The error is above the limit, also with the safety margin taken off.",
}

NAMED_SOURCES = 4
"""Number of sources of uncertainty of a length check that are printed, the largest first."""

NO_ERROR_SHARE = 0.05
"""Share of U below which an error of the best geometry alone is none."""

SMALLEST_MOVE = 0.001
"""Smallest displacement of what was taught that is printed, mm or deg: that of the numbers in a config."""


def verification_text(verified: Verification) -> str:
    """A few lines: the verdict with its reason first."""
    verdict = f"verdict: {verified.verdict}"
    if verified.tests and all(test.passed for test in verified.tests):
        verdict += f"; the model agrees with the records in {len(verified.tests)} tests"
    lines = [verdict, *_error_lines(verified.accuracy)]
    if verified.before_mm is not None and verified.after_mm is not None:
        worse = ", significantly worse" if verified.is_worse else ""
        means = from_to(verified.before_mm, verified.after_mm, 2)
        lines.append(f"  mean deviation at held-out poses {means}{worse}")
    lines += [f"  {test.sentence}" for test in verified.tests if not test.passed]
    if verified.accuracy is not None:
        lines += [f"  {line}" for line in scale_lines(verified.accuracy.length, verified.accuracy.scale_of)]
    return "\n".join(lines)


def _size(error: JudgedError, unit: str) -> str:
    if error.expanded is None:
        return error.with_u(unit)
    shown = error.shown_in(unit)
    return f"{shown.length(error.value)}, U {shown.number(error.expanded)}"


def _error_lines(accuracy: VerifiedAccuracy | None) -> Iterator[str]:
    """The errors at the task poses with U; the guard band where these do not explain the verdict."""
    if accuracy is None:
        return
    what = "task poses" if accuracy.task_named else "poses across the workspace"
    for name, unit, error in accuracy.errors:
        where = f"at {accuracy.poses} {what}" if name == "position" else "there"
        limit = error.shown_in(unit).limit(error.limit)
        yield f"  largest {name} error {where}: {_size(error, unit)} (limit {limit})"
    if accuracy.approach:
        yield f"  {accuracy.approach}"
    if (geometry := accuracy.of_geometry) is not None:
        size = _size(geometry.position, "mm")
        yield f"  of that by the geometry: {size}: {geometry.verdict}; the rest is scatter"
    if accuracy.either_side:
        yield wrapped(f"  {_either_side(accuracy.either_side)}", indent=2)
    guard_bands = [error.guard_band for _, _, error in accuracy.errors if error.guard_band]
    if guard_bands:
        yield f"  a pass and a fail keep {guard_bands[0]} from the limit"


def _either_side(places: Sequence[EitherSide]) -> str:
    """At which pose that matters most, and what helps."""
    worst, *_ = places
    more = len({one.pose for one in places}) - 1
    others = f" So at {counted(more, 'other task pose')}." if more else ""
    legs = "leg" if len(worst.legs) == 1 else "legs"
    return (
        f"at the task pose {Pose(*worst.pose)} the weight may as well lay {legs} "
        f"{', '.join(map(str, worst.legs))} on the other side of the play, with the ball "
        f"{shown(worst.apart_mm)} away. No controller corrects that: load the leg that hardly is, take up "
        f"its play, or change the pose.{others}"
    )


def check_text(found: CheckResult) -> str:
    """A few lines on a check: the verdict, the error now, and what has changed."""
    lines = [f"verdict: {found.verdict}", *_error_lines(found.accuracy), *_change_lines(found)]
    if found.alarm is not None and found.alarm.is_raised:
        lines.append(f"  {alarm_sentence(found.alarm)}")
    if not found.is_consistent:
        lines.append("  the residuals are larger than the stated noise explains: the model does not hold")
    if found.accuracy is not None:
        lines.append(f"  {earlier_scale_line(found.accuracy.length, found.accuracy.scale_of)}")
    return "\n".join(lines)


def _change_lines(found: CheckResult) -> Iterator[str]:
    """The parameter that has changed most, if that is significant."""
    if found.earlier_at is None or not found.changes:
        return
    most, since = found.significant_change, f"{found.earlier_at:%Y-%m-%d}"
    if most is not None:
        yield f"  changed most since {since}: {most.name} by {change_with_sigma(most)}"
    elif found.verdict is Verdict.PASS:
        yield f"  no parameter has changed significantly since {since}"


def alarm_sentence(alarm: ChangeAlarm) -> str:
    """What an alarm means, and what to do."""
    unit = unit_of(alarm.change, alarm.sigma, unit=alarm.unit)
    size = f"{unit.number(alarm.change, '+')} +- {unit.length(alarm.sigma)}"
    return (
        f"alarm: the first {alarm.records} records contradict an unchanged machine (score "
        f"{alarm.score:.1f}, by chance {alarm.limit:.1f} in one check of 100). If one part changed, it is "
        f"of leg {alarm.leg}, as by {size} of {alarm.parameter}. Repeat the check: this is no verdict"
    )


def not_checked(scale_of: str = "encoders") -> str:
    """Where the length scale comes from, if nobody checked it."""
    if scale_of == "encoders":
        return "The length scale is that of the encoders; it was not checked."
    return "The length scale is that of the drawing, within its tolerances, which U contains."


def scale_lines(length: LengthResult | None, scale_of: str = "encoders") -> list[str]:
    """What is known of the length scale; empty where a check contradicts itself, which its test says."""
    if length is None:
        return [not_checked(scale_of)]
    if not length.is_consistent:
        return []
    checked = f"length scale: checked over {length.distance_mm:.3f} mm: {scale_words(length)}"
    if not length.is_significant:
        return [checked]
    remedy = (
        f"No geometry corrects that: multiply the scale factor of all encoders by {length.factor:.6f}, at "
        "the drives and in [encoders] measuring_step_nm, and calibrate again."
    )
    return [checked, remedy]


def earlier_scale_line(length: LengthResult | None, scale_of: str = "encoders") -> str:
    """What a check knows of the length scale, by the run of the result that it started from."""
    if length is None or not length.is_consistent:
        return not_checked(scale_of)
    return f"length scale: as checked in that run: {scale_words(length)}"


def length_text(stated: LengthStatement) -> str:
    """A few lines: the verdict, the scale, what it does at the task, and what U consists of."""
    result, error = stated.result, stated.error
    lines = [f"verdict: {stated.verdict}"]
    if not result.is_consistent:
        return "\n".join([*lines, f"  the length check says nothing: {result.reason}"])
    lines += [f"  {line}" for line in scale_lines(result)]
    if error is not None:
        size = f"{_size(error, 'mm')} ({error.rule('mm')})"
        lines.append(f"  position error by that at the task poses: {size}")
    largest = sorted(result.sources, key=lambda source: -source.um_m)[:NAMED_SOURCES]
    named = ", ".join(f"{source.name} {source.um_m:.1f}" for source in largest)
    return "\n".join([*lines, f"  uncertainty, um/m, 1 sigma: {named}"])


def improvement_sentence(
    expected: ExpectedImprovement | None, verified: VerifiedAccuracy | None = None
) -> str:
    """What a change of the controller's config improves, or improved; empty if that is not known.

    ``verified`` is the accuracy that was judged afterwards.
    """
    if expected is None:
        return ""
    now = f"{expected.now_mm:.3g} mm" if unit_of(expected.now_mm) is MM else shown(expected.now_mm)
    before, after = "the current config", f"0 +- {shown(expected.expanded_mm)} with this one"
    if verified is not None:
        before, after = "the config before", f"{verified.position.with_u('mm')} with the new config"
        if (alone := verified.alone) is not None:
            size, expanded = alone.with_u("mm"), alone.expanded
            if expanded is not None and alone.value < NO_ERROR_SHARE * expanded:
                size = f"up to {shown(expanded)}"  # by the side of arrival: the geometry is right
            after = f"{size} with the best geometry alone, {after}"
    return f"Largest position error at the task poses: {now} with {before}, {after}."


def teaching_sentence(moved: TaskDisplacement | None) -> str:
    """What must be taught anew because of a new geometry, and what not; empty if that is not known."""
    if moved is None:
        return ""
    how_far = f"{_how_far(moved)} at the task poses"
    if moved.is_within_limits:
        return f"Nothing need be taught anew: taught points and frames move by at most {how_far}."
    return (
        f"Teach anew: Cartesian points, work and tool frames move by up to {how_far}. "
        "Points taught by joints stay."
    )


def teaching_line(moved: TaskDisplacement) -> str:
    """What must be taught anew, in a line of at most 80 columns."""
    if moved.is_within_limits:
        return f"Taught points and frames stay: they move by at most {_how_far(moved)}"
    return f"Teach Cartesian points and frames anew: they move by up to {_how_far(moved)}"


def _how_far(moved: TaskDisplacement) -> str:
    mm, deg = (
        f"{max(value, SMALLEST_MOVE):.{1 if value >= 10.0 else 2 if value >= 1.0 else 3}f}"
        for value in (moved.position_mm, moved.orientation_deg)
    )
    return f"{mm} mm, {deg} deg"
