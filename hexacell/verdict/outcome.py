"""The outcome of a calibration, a check or a length check in one line, for the journal and for people."""

from collections.abc import Sequence

from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.lengths import from_to
from hexacell.results.result import IdentificationResult, LengthResult
from hexacell.verdict.decision import Verdict, VerifiedAccuracy, worst_verdict
from hexacell.verdict.length_check import LengthStatement
from hexacell.verdict.model_evidence import ZEROS_DOUBTED, doubts_zeros
from hexacell.verdict.verification import Verification


def outcome_line(
    result: IdentificationResult, parameters: int, verified: Verification, unknowns: int | None = None
) -> str:
    """The outcome of a calibration in one line: what was used, before and after, the error, the verdict.

    ``unknowns``: how many of the parameters are identified, if not all.
    """
    what = f"{parameters} parameters"
    if result.identifies is not ParameterChoice.ALL:
        what = f"zeros only, {unknowns} of {what}"
    parts = [f"{what}, {result.records} records at {result.points} points"]
    if verified.before_mm is not None and verified.after_mm is not None:
        means = from_to(verified.before_mm, verified.after_mm, 2)
        parts.append(f"mean deviation at held-out poses {means}")
    return outcome_of(parts, verified.accuracy, verified.verdict, reason_of(verified))


def outcome_of(
    parts: Sequence[str], accuracy: VerifiedAccuracy | None, verdict: Verdict, reason: str
) -> str:
    """An outcome in one line: some parts, the error that decides, the verdict, and its reason if any.

    Where both errors decide it is that of the position.
    """
    parts = list(parts)
    if accuracy is not None:
        worst = worst_verdict(error.verdict for _, _, error in accuracy.errors)
        name, unit, error = next(one for one in accuracy.errors if one[2].verdict is worst)
        parts.append(f"{name} error at the task poses {error.sentence(unit)}")
    because = f" ({reason})" if reason else ""
    return f"{'; '.join(parts)}: {verdict}{because}"


def reason_of(verified: Verification) -> str:
    """Why a verdict is not that of the error shown; empty where it is."""
    failed = [test.sentence for test in verified.tests if not test.passed]
    if verified.is_worse:
        doubt = f"; {ZEROS_DOUBTED.rstrip('.')}" if doubts_zeros(verified.tests) else ""
        return f"worse than before{doubt}"
    if verified.verdict is Verdict.NOT_EVALUATED and failed:
        return failed[0].rstrip(".")
    if verified.is_kept and verified.verdict is not Verdict.PASS:
        return "the machine does not repeat well enough; the geometry is better, and stays"
    if verified.verdict is Verdict.NOT_EVALUATED and verified.accuracy is not None:
        return "U is above the limit"
    return ""


def scale_words(result: LengthResult) -> str:
    """The scale of the encoders with U, in words."""
    wrong_way = "long" if result.long_um_m >= 0.0 else "short"
    return f"encoders read {abs(result.long_um_m):.0f} +- {result.expanded_um_m:.0f} um/m {wrong_way}"


def length_line(stated: LengthStatement) -> str:
    """The outcome of a length check in one line."""
    result, error = stated.result, stated.error
    if not result.is_consistent:
        return f"length check: {stated.verdict} ({result.reason})"
    parts = [f"length check over {result.distance_mm:.3f} mm: {scale_words(result)}"]
    if error is not None:
        parts.append(f"position error by that {error.sentence('mm')}")
    return f"{'; '.join(parts)}: {stated.verdict}"
