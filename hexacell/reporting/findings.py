"""What an identification and its assessment mean, in sentences for people; the gravest first."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.identification.diagnostics.tolerance_check import ToleranceViolation
from hexacell.identification.solver.chi_square import ChiSquareTest, ChiSquareVerdict
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.mechanism import FrameConvention
from hexacell.kinematics.parameter_names import display_name
from hexacell.reporting.assessment import Assessment

RETURNS_BADLY = 2.0
"""Scatter on returning over that of the stated noise, from which on it is worth a sentence."""


def findings(found: Identification, assessed: Assessment) -> tuple[str, ...]:
    """The verdict, what it promises, and whatever else a person should know before using the result."""
    sentences = (
        _verdict(found, assessed),
        _promise(assessed),
        _returns_badly(assessed),
        _noise(assessed),
        _unreachable(assessed),
        *map(str, found.data_faults),
    )
    return tuple(sentence for sentence in sentences if sentence)


def pair_sentences(found: Identification, assessed: Assessment) -> tuple[str, ...]:
    """For the strongest correlations: the pair, and the measurement that would part it."""
    convention = found.problem.mechanism.convention
    sentences = []
    for pair, part in zip(assessed.correlated, assessed.partings, strict=False):
        first, second = (display_name(name, convention) for name in (pair.first, pair.second))
        fact = f"{first} and {second} cannot be told apart from these poses"
        way = (
            "no single tilt at these points would part them"
            if part is None
            else f"{'turn' if part.axis == 'z' else 'tilt'} {part.degrees:+.0f} deg about {part.axis} "
            f"at point {part.point}"
        )
        sentences.append(f"{fact} ({pair.correlation:+.2f}): {way}")
    return tuple(sentences)


def _verdict(found: Identification, assessed: Assessment) -> str:
    if not found.converged:
        return f"No result: the solver ended because {found.termination.value}."
    if assessed.tolerance_violations:
        return _beyond_tolerance(assessed.tolerance_violations, found.problem.mechanism.convention)
    if assessed.does_not_repeat:
        return _recalibrating_will_not_help(assessed)
    if assessed.refused:
        return _contradicted(assessed.goodness)
    if found.undetermined:
        return f"Incomplete: {_undetermined(found)} not determined by these data."
    return _by_residuals(assessed.goodness)


def _beyond_tolerance(beyond: Sequence[ToleranceViolation], convention: FrameConvention) -> str:
    names = ", ".join(
        f"{display_name(one.name, convention)} is {one.change_mm:+.2f} mm from the drawing "
        f"(tolerance {one.tolerance_mm:g}, sigma {one.sigma_mm:.2g})"
        for one in beyond
    )
    return (
        f"Refused: {names}. A good residual is no proof: measure that on the machine, and correct the "
        "drawing or its tolerance in the cell file, or look for what else is wrong."
    )


def _contradicted(goodness: ChiSquareTest) -> str:
    return (
        f"Refused: the residuals are {goodness.ratio:.0f} times the stated noise, and no single mistake "
        "explains them. Check that the drawing, the controller's config and the branch are this machine's, "
        "and that the ball and the gauges sit tight."
    )


def _by_residuals(goodness: ChiSquareTest) -> str:
    match goodness.agreement:
        case ChiSquareVerdict.TOO_LARGE:
            scale = f"Every parameter's sigma is really {goodness.ratio:.1f} times as large."
            return f"Doubtful: {_lower(goodness.sentence)} {scale}"
        case ChiSquareVerdict.NOT_EVALUATED:
            return f"Not proven: {_lower(goodness.sentence)}"
        case ChiSquareVerdict.TOO_SMALL:
            return f"Good: the records determine every parameter. {goodness.sentence}"
        case ChiSquareVerdict.AGREES:
            return "Good: the records determine every parameter, and agree with the stated noise."


def _undetermined(found: Identification) -> str:
    convention = found.problem.mechanism.convention
    free = convention.free_names()
    names = [display_name(name, convention) for name in found.undetermined if name in free]
    if len(names) > 4:
        return f"{len(names)} of {len(free)} parameters are"
    return f"{', '.join(names)} {'is' if len(names) == 1 else 'are'}"


def _promise(assessed: Assessment) -> str:
    accuracy = assessed.accuracy
    if accuracy is None:
        return "The robot can take none of the task poses: no accuracy can be stated."
    where = "task poses" if assessed.task_named else "poses across the workspace"
    before, after = accuracy.before, accuracy.after
    return (
        f"At {len(accuracy.poses)} {where} the robot now errs by {before.position_rms_mm:.3g} mm (rms), "
        f"with the identified geometry by {after.position_rms_mm:.2g} mm (one sigma)."
    )


def _recalibrating_will_not_help(assessed: Assessment) -> str:
    scatter, accuracy = assessed.repeatability, assessed.accuracy
    if scatter is None or accuracy is None:
        return ""
    return (
        f"Recalibrating will not help: the machine comes back only to within {scatter.distance_mm:.3f} mm, "
        f"and a better geometry would take away {accuracy.removable_mm:.3f} mm."
    )


def _returns_badly(assessed: Assessment) -> str:
    scatter, explained_mm = assessed.repeatability, assessed.record_noise_mm
    if scatter is None or assessed.does_not_repeat or not scatter.dominates(RETURNS_BADLY * explained_mm):
        return ""
    return (
        f"On returning to a pose the ball is {scatter.distance_mm:.3f} mm off, "
        f"{scatter.distance_mm / explained_mm:.1f} times what the stated noise explains: look for play, "
        "for slip at the gauges, for warming."
    )


def _noise(assessed: Assessment) -> str:
    """Levels that are surely not the stated ones; where the residuals are right, there is no need."""
    if assessed.noise is None or assessed.goodness.agreement in {
        ChiSquareVerdict.AGREES,
        ChiSquareVerdict.NOT_EVALUATED,
    }:
        return ""
    return assessed.noise.sentence


def _unreachable(assessed: Assessment) -> str:
    if assessed.accuracy is None or assessed.accuracy.reachable.all():
        return ""
    places = [str(place) for place, fits in enumerate(assessed.accuracy.reachable, start=1) if not fits]
    return f"Task poses that the robot cannot take are left out: {', '.join(places)}."


def _lower(sentence: str) -> str:
    return sentence[0].lower() + sentence[1:]
