"""What must hold before a new geometry may enter a controller."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.identification.diagnostics.tolerance_check import tolerance_violations
from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry


@dataclass(frozen=True, slots=True)
class AcceptanceGate:
    """One condition, and the sentence that says how it stands.

    ``needs_person``: where it is not met, a person may still decide to go on.
    """

    name: str
    passed: bool
    sentence: str
    needs_person: bool = False


def gates(
    identified: Identification,
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
        _small_enough(identified.geometry, before, largest_change_mm),
    )


def _converged(identified: Identification) -> AcceptanceGate:
    return AcceptanceGate(
        "converged", identified.converged, f"The solver ended because {identified.termination.value}."
    )


def _determined(identified: Identification) -> AcceptanceGate:
    names = identified.undetermined
    sentence = (
        f"Not determined by these data: {', '.join(names)}."
        if names
        else "The data determine every parameter."
    )
    return AcceptanceGate("determined", not names, sentence, needs_person=True)


def _within_tolerance(
    identified: Identification, drawing: Geometry, tolerances: Tolerances
) -> AcceptanceGate:
    beyond = tolerance_violations(identified, drawing, tolerances)
    names = ", ".join(f"{excess.name} ({excess.change_mm:+.2f} mm)" for excess in beyond)
    sentence = (
        f"Beyond the drawing's tolerance: {names}."
        if beyond
        else "Every parameter is within the drawing's tolerance."
    )
    return AcceptanceGate("within tolerance", not beyond, sentence)


def _small_enough(after: Geometry, before: Geometry, largest_change_mm: float) -> AcceptanceGate:
    change = after.largest_difference(before)
    return AcceptanceGate(
        "small change",
        change <= largest_change_mm,
        f"The largest change is {change:.2f} mm (limit without a person {largest_change_mm:g} mm).",
        needs_person=True,
    )
