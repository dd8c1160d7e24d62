"""Text for the verification of a result: verdict, errors at the task poses, and evidence."""

from __future__ import annotations

from hexacell.presentation.layout import wrapped
from hexacell.reporting.verification import JudgedError, Verification, VerifiedAccuracy

SCALE = "The length scale is that of the encoders; it was not checked."


def verification_text(verified: Verification) -> str:
    """A few lines: the verdict with its reason first."""
    lines = [f"verdict: {verified.verdict}", *_errors(verified.accuracy), *_comparison(verified)]
    lines += [wrapped(test.sentence, indent=2) for test in verified.tests if not test.passed]
    if verified.tests and all(test.passed for test in verified.tests):
        lines.append(f"  the model agrees with the records in {len(verified.tests)} tests")
    if verified.accuracy is not None:
        lines.append(f"  {SCALE}")
    return "\n".join(lines)


def _errors(accuracy: VerifiedAccuracy | None) -> list[str]:
    if accuracy is None:
        return []
    what = "task poses" if accuracy.task_named else "poses across the workspace"
    return [
        _error(f"largest position error at {accuracy.poses} {what}", accuracy.position, "mm"),
        _error("largest orientation error there", accuracy.orientation, "deg"),
    ]


def _error(what: str, error: JudgedError, unit: str) -> str:
    """U is the expanded uncertainty."""
    stated = f"{error.value:.3f} {unit}, U {error.expanded:.3f} (limit {error.limit:g})"
    return f"  {what}: {stated}"


def _comparison(verified: Verification) -> list[str]:
    if verified.before_mm is None or verified.after_mm is None:
        return []
    means = f"{verified.before_mm:.2f} -> {verified.after_mm:.3f} mm"
    worse = ", significantly worse" if verified.is_worse else ""
    return [f"  mean deviation at held-out poses {means}{worse}"]
