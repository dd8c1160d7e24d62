"""The meaning of an identification and its assessment, in sentences for people; the most serious first."""

from collections.abc import Sequence

from hexacell.identification.diagnostics.model_tests import contradicted_points
from hexacell.identification.diagnostics.tolerance_check import ToleranceViolation
from hexacell.identification.solver.chi_square import ChiSquareTest, ChiSquareVerdict
from hexacell.kinematics.mechanism import FrameConvention
from hexacell.kinematics.parameters import JointUnit
from hexacell.lengths import shown, unit_of
from hexacell.noise.record_noise import NoiseLevel, NoiseLevels
from hexacell.results.result import legs_at
from hexacell.verdict.acceptance_gates import residual_sentence
from hexacell.verdict.assessment import SEPARATED_PAIRS, Assessment

POOR_REPEATABILITY = 2.0
"""Ratio of the scatter of repeated poses to the stated noise from which it is a finding."""

NAMED_PARAMETERS = 4
"""Largest number of undetermined parameters that are named; more are counted."""


def findings(assessed: Assessment) -> tuple[str, ...]:
    """Verdict, accuracy, and everything else to know before the result is used, one sentence each."""
    sentences = (
        _verdict(assessed),
        _possible_causes(assessed),
        _accuracy(assessed),
        _poor_repeatability(assessed),
        _noise(assessed),
        _undetermined(assessed),
        _unreachable(assessed),
        _temperatures(assessed),
        *map(str, assessed.found.data_faults),
    )
    return tuple(sentence for sentence in sentences if sentence)


def pair_sentences(assessed: Assessment) -> tuple[str, ...]:
    """For the strongest correlations: the pair, and the measurement that would separate it."""
    convention = assessed.found.problem.mechanism.convention
    sentences = []
    for pair, pose in assessed.correlated[:SEPARATED_PAIRS]:
        first, second = (convention.display_name(name) for name in (pair.first, pair.second))
        fact = f"{first} and {second} cannot be separated from these poses"
        remedy = (
            "no single tilt at these points would separate them"
            if pose is None
            else f"{'turn' if pose.axis == 'z' else 'tilt'} {pose.degrees:+.0f} deg about {pose.axis} "
            f"at point {pose.point}"
        )
        sentences.append(f"{fact} ({pair.correlation:+.2f}): {remedy}")
    return tuple(sentences)


def noise_sentence(levels: NoiseLevels) -> str:
    """The noise levels that the residuals show."""
    if not levels.are_separable:
        return "The noise of the encoders and of the gauges cannot be separated with these records."
    encoders = _noise_level("encoders", levels.encoder, levels.joint_unit)
    gauges = _noise_level("gauges", levels.gauge, JointUnit.MM)
    return f"Noise by the residuals: {encoders}; {gauges}."


def _noise_level(kind: str, level: NoiseLevel, unit: JointUnit) -> str:
    in_unit = unit_of(level.stated, unit=unit)
    stated = f"(stated {in_unit.limit(level.stated)})"
    if not level.is_resolved:
        return f"{kind} below {in_unit.length(level.at_most)} {stated}"
    return f"{kind} {in_unit.number(level.estimated)} +- {in_unit.length(level.standard_error)} {stated}"


def _verdict(assessed: Assessment) -> str:
    found = assessed.found
    if not found.termination.converged:
        return f"No result: the solver ended because {found.termination.value}."
    if assessed.tolerance_violations:
        return _beyond_tolerance(assessed.tolerance_violations, found.problem.mechanism.convention)
    if assessed.does_not_repeat:
        return _no_gain(assessed)
    if assessed.refused:
        why = (
            f"the residuals are {found.goodness.ratio:.0f} times the stated noise, and no single mistake "
            "explains them. Check that the drawing, the controller's config and the branch are this "
            "machine's, and that the ball and the gauges are clamped."
        )
        return f"Refused: {assessed.gates[-1].sentence if assessed.impossible else why}"
    if assessed.determines_too_little:
        return (
            f"Incomplete: these records leave {shown(2.0 * assessed.unknown_mm)} of the error at the worst "
            f"task pose unknown (two sigma; its limit is {shown(assessed.limit_mm)}). Measure at more "
            "points, and in more orientations with larger tilts."
        )
    return _point_verdict(assessed) or _residual_verdict(found.goodness)


def _undetermined(assessed: Assessment) -> str:
    """The parameters that stay as the drawing has them; U contains what they do at the task poses."""
    convention = assessed.found.problem.mechanism.convention
    free = convention.free_names
    names = [convention.display_name(name) for name in assessed.undetermined if name in free]
    if not names:
        return ""
    shown = ", ".join(names[:NAMED_PARAMETERS])
    more = ", ..." if len(names) > NAMED_PARAMETERS else ""
    return (
        f"Of {len(free)} parameters these records hardly determine {len(names)} ({shown}{more}): they stay "
        "near the drawing, and U contains what that does at the task poses."
    )


def _point_verdict(assessed: Assessment) -> str:
    """Doubt where records agree with the noise together, and contradict each other by points."""
    contradicted = contradicted_points(assessed.points)
    if not contradicted or assessed.found.goodness.agreement is ChiSquareVerdict.TOO_LARGE:
        return ""
    worst = max(contradicted, key=lambda point: contradicted[point].ratio)
    return (
        f"Doubtful: the records of point {worst} are {contradicted[worst].ratio:.1f} times as far as the "
        "stated noise explains from what the other points predict, so the model does not hold."
    )


def _beyond_tolerance(violations: Sequence[ToleranceViolation], convention: FrameConvention) -> str:
    names = ", ".join(
        f"{convention.display_name(one.name)} is {shown(one.change, '+', one.unit)} from the drawing "
        f"(tolerance {one.tolerance:g}, sigma {one.sigma:.2g})"
        for one in violations
    )
    others = " or ".join(violations[0].instead)
    instead = f"; {others} out of its tolerance would explain the records as well" if others else ""
    return (
        f"Refused: {names}{instead}. A good residual is no proof: measure that on the machine, and correct "
        "the drawing or its tolerance in the cell file, or find the other cause."
    )


def _residual_verdict(goodness: ChiSquareTest) -> str:
    sentence = residual_sentence(goodness)
    lower = f"{sentence[0].lower()}{sentence[1:]}"
    match goodness.agreement:
        case ChiSquareVerdict.TOO_LARGE:
            scale = f"Every parameter's sigma is in fact {goodness.ratio:.1f} times as large."
            return f"Doubtful: {lower} {scale}"
        case ChiSquareVerdict.NOT_EVALUATED:
            return f"Not proven: {lower}"
        case ChiSquareVerdict.TOO_SMALL:
            return f"Good, though {lower}"
        case ChiSquareVerdict.AGREES:
            return "Good: the records agree with the stated noise."


def _possible_causes(assessed: Assessment) -> str:
    """Possible causes, where the residuals are too large and nothing that was left out explains it."""
    if causes := ", ".join(f"{cause.name} {100 * cause.share:.0f} %" for cause in assessed.possible_causes):
        return (
            "The model does not fit, and no cause is proven. What may be, by the share of the excess that "
            f"it would explain: {causes}."
        )
    if assessed.refused or assessed.found.goodness.agreement is not ChiSquareVerdict.TOO_LARGE:
        return ""
    return (
        "The model does not fit, and no cause is proven: neither encoders, guides, load, temperature "
        "nor gauges would explain a tenth of the excess."
    )


def _accuracy(assessed: Assessment) -> str:
    if (accuracy := assessed.accuracy) is None:
        return "The robot can reach none of the task poses: no accuracy can be stated."
    where = "task poses" if assessed.task_named else "poses across the workspace"
    before, after = shown(accuracy.before.position_rms_mm), shown(accuracy.after.position_rms_mm)
    return (
        f"At {len(accuracy.poses)} {where} the position error is now {before} (rms), and {after} "
        "with the identified geometry (one sigma)."
    )


def _no_gain(assessed: Assessment) -> str:
    scatter, accuracy = assessed.repeatability, assessed.accuracy
    if scatter is None or accuracy is None:
        return ""
    return (
        f"Recalibrating will not help: the machine repeats only to within {shown(scatter.distance_mm)}, "
        f"and a better geometry would remove {shown(accuracy.removable_mm)}."
    )


def _poor_repeatability(assessed: Assessment) -> str:
    scatter, noise_mm = assessed.repeatability, assessed.record_noise_mm
    if scatter is None or assessed.does_not_repeat or not scatter.dominates(POOR_REPEATABILITY * noise_mm):
        return ""
    return (
        f"On returning to a pose the ball is {shown(scatter.distance_mm)} off, "
        f"{scatter.distance_mm / noise_mm:.1f} times what the stated noise explains: look for play, "
        "slipping gauges or thermal drift."
    )


def _noise(assessed: Assessment) -> str:
    """The noise levels, where the residuals contradict the stated ones."""
    no_contradiction = {ChiSquareVerdict.AGREES, ChiSquareVerdict.NOT_EVALUATED}
    if assessed.noise is None or assessed.found.goodness.agreement in no_contradiction:
        return ""
    return noise_sentence(assessed.noise)


def _unreachable(assessed: Assessment) -> str:
    if assessed.accuracy is None or assessed.accuracy.reachable.all():
        return ""
    numbered = enumerate(assessed.accuracy.reachable, start=1)
    unreachable = ", ".join(str(number) for number, is_reachable in numbered if not is_reachable)
    return f"Task poses that the robot cannot reach are left out: {unreachable}."


def _temperatures(assessed: Assessment) -> str:
    legs = legs_at(assessed.found.problem.holds_at)
    return f"The geometry is that with {legs}." if legs else ""
