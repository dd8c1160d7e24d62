"""The conditions that an identification must meet before its geometry is written to a controller."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from hexacell.identification.diagnostics.tolerance_check import tolerance_violations
from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics.geometry import Geometry


class AcceptanceGate(BaseModel):
    """One condition for writing back, whether it is met, and that as a sentence for people.

    ``needs_person``: where it is not met, a person may accept the geometry nevertheless.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    passed: bool
    sentence: str
    needs_person: bool = False


def gates(
    identified: GeometryEstimate,
    drawing: Geometry,
    tolerances: Tolerances,
    *,
    largest_change_mm: float,
    before: Geometry,
) -> tuple[AcceptanceGate, ...]:
    """All conditions on an identification; ``before`` is the controller's geometry in its frame."""
    return (
        _converged(identified),
        _determined(identified),
        _within_tolerance(identified, drawing, tolerances),
        _small_change(identified.geometry, before, largest_change_mm),
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


def _within_tolerance(
    identified: GeometryEstimate, drawing: Geometry, tolerances: Tolerances
) -> AcceptanceGate:
    violations = tolerance_violations(identified, drawing, tolerances)
    names = ", ".join(f"{violation.name} ({violation.change_mm:+.2f} mm)" for violation in violations)
    sentence = (
        f"Beyond the drawing's tolerance: {names}."
        if violations
        else "Every parameter is within the drawing's tolerance."
    )
    return AcceptanceGate(name="within tolerance", passed=not violations, sentence=sentence)


def _small_change(after: Geometry, before: Geometry, largest_change_mm: float) -> AcceptanceGate:
    change_mm = after.largest_difference(before)
    return AcceptanceGate(
        name="small change",
        passed=change_mm <= largest_change_mm,
        sentence=(
            f"The largest change is {change_mm:.2f} mm (limit without a person {largest_change_mm:g} mm)."
        ),
        needs_person=True,
    )
