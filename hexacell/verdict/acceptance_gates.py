"""Gates that an identified geometry must pass before it is written to a controller."""

from __future__ import annotations

from collections.abc import Sequence

from hexacell.cell.fields import Frozen
from hexacell.identification.diagnostics.tolerance_check import ToleranceViolation
from hexacell.identification.solver.chi_square import (
    CONTRADICTED_RATIO,
    ChiSquareTest,
    ChiSquareVerdict,
)
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics.geometry import Geometry


class AcceptanceGate(Frozen):
    """A condition for writing back, whether it is met, and that as a sentence for people.

    ``needs_person``: where it is not met, a person may accept the geometry nevertheless, with
    ``needs_cell_name`` by typing the name of the cell.
    """

    name: str
    passed: bool
    sentence: str
    needs_person: bool = False
    needs_cell_name: bool = False


def gates(
    identified: GeometryEstimate,
    violations: Sequence[ToleranceViolation],
    *,
    residuals: ChiSquareTest,
    largest_change_mm: float,
    before: Geometry,
    expired: Sequence[str] | None = None,
) -> tuple[AcceptanceGate, ...]:
    """All gates of an identification.

    Args:
        identified: the geometry, in the mechanism's frame convention.
        violations: of the drawing's tolerances.
        residuals: the chi-square test of the residuals.
        largest_change_mm: what may change without a person.
        before: the controller's geometry, in the same convention: other frames are no other robot.
        expired: instruments whose certificate had expired when the run began; None without certificates.
    """
    certified = () if expired is None else (_certified(expired),)
    return (
        _converged(identified),
        _determined(identified),
        _agrees(residuals),
        _within_tolerance(violations),
        _small_change(identified.geometry, before, largest_change_mm),
        *certified,
    )


def _converged(identified: GeometryEstimate) -> AcceptanceGate:
    return AcceptanceGate(
        name="converged",
        passed=identified.termination.converged,
        sentence=f"The solver ended because {identified.termination.value}.",
    )


def _determined(identified: GeometryEstimate) -> AcceptanceGate:
    names = identified.undetermined
    sentence = (
        f"Not determined by these data: {', '.join(names)}."
        if names
        else "The data determine every parameter."
    )
    return AcceptanceGate(name="determined", passed=not names, sentence=sentence, needs_person=True)


def _agrees(residuals: ChiSquareTest) -> AcceptanceGate:
    """A geometry whose residuals the noise does not explain is doubtful: a person decides."""
    passed = residuals.is_explained
    sentence = "The residuals agree with the stated noise."
    if residuals.agreement is ChiSquareVerdict.NOT_EVALUATED:
        sentence = "The residuals prove nothing: there are no more records than unknowns."
    elif not passed:
        sentence = f"Doubtful: the residuals are {residuals.ratio:.1f} times the stated noise."
    return AcceptanceGate(
        name="agrees with the noise",
        passed=passed,
        sentence=sentence,
        needs_person=not residuals.ratio > CONTRADICTED_RATIO,
    )


def _within_tolerance(violations: Sequence[ToleranceViolation]) -> AcceptanceGate:
    """The drawing may be of another machine; who knows better types the cell's name."""
    names = ", ".join(
        f"{violation.name} ({violation.change:+.2f} {violation.unit})" for violation in violations
    )
    sentence = (
        f"Beyond the drawing's tolerance: {names}."
        if violations
        else "Every parameter is within the drawing's tolerance."
    )
    return AcceptanceGate(
        name="within tolerance",
        passed=not violations,
        sentence=sentence,
        needs_person=True,
        needs_cell_name=True,
    )


def _small_change(after: Geometry, before: Geometry, largest_change_mm: float) -> AcceptanceGate:
    """A robot that moves far from where it did may collide; who knows better types the cell's name."""
    change_mm = after.largest_difference(before)
    return AcceptanceGate(
        name="small change",
        passed=change_mm <= largest_change_mm,
        sentence=(
            f"The largest change is {change_mm:.2f} mm, the choice of frames apart "
            f"(limit without a person {largest_change_mm:g} mm)."
        ),
        needs_person=True,
        needs_cell_name=not change_mm <= largest_change_mm,
    )


def _certified(expired: Sequence[str]) -> AcceptanceGate:
    """A result by an instrument with an expired certificate needs a person: others do not accept it."""
    sentence = (
        f"The certificate has expired: {', '.join(expired)}."
        if expired
        else "The certificates of the instruments were valid when the run began."
    )
    return AcceptanceGate(name="certified", passed=not expired, sentence=sentence, needs_person=True)
