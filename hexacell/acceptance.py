"""What must hold before a new geometry may enter a controller."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.geometry import Geometry
from hexacell.identification.problem import Tolerances
from hexacell.identification.result import Identification
from hexacell.identification.tolerance import beyond_tolerance


@dataclass(frozen=True, slots=True)
class Gate:
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
) -> tuple[Gate, ...]:
    """All conditions on an identification; ``before`` is the controller's geometry in its frame."""
    return (
        _converged(identified),
        _determined(identified),
        _within_tolerance(identified, drawing, tolerances),
        _small_enough(identified.geometry, before, largest_change_mm),
    )


def _converged(identified: Identification) -> Gate:
    return Gate(
        "converged", identified.converged, f"The solver ended because {identified.termination.value}."
    )


def _determined(identified: Identification) -> Gate:
    names = identified.undetermined
    sentence = (
        f"Not determined by these data: {', '.join(names)}."
        if names
        else "The data determine every parameter."
    )
    return Gate("determined", not names, sentence, needs_person=True)


def _within_tolerance(identified: Identification, drawing: Geometry, tolerances: Tolerances) -> Gate:
    beyond = beyond_tolerance(identified, drawing, tolerances)
    names = ", ".join(f"{excess.name} ({excess.change_mm:+.2f} mm)" for excess in beyond)
    sentence = (
        f"Beyond the drawing's tolerance: {names}."
        if beyond
        else "Every parameter is within the drawing's tolerance."
    )
    return Gate("within tolerance", not beyond, sentence)


def _small_enough(after: Geometry, before: Geometry, largest_change_mm: float) -> Gate:
    change = after.largest_difference(before)
    return Gate(
        "small change",
        change <= largest_change_mm,
        f"The largest change is {change:.2f} mm (limit without a person {largest_change_mm:g} mm).",
        needs_person=True,
    )
