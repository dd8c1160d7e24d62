"""Acceptance of a result: gates before its geometry is written to a controller, validation afterwards.

The validation compares the deviations of the ball at held-out points before and after the calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from hexacell.cell.fields import Frozen
from hexacell.identification.diagnostics.parameter_checks import tolerance_violations
from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array


class AcceptanceGate(Frozen):
    """One condition for writing back, whether it is met, and that as a sentence for people.

    ``needs_person``: where it is not met, a person may accept the geometry nevertheless.
    """

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


class HeldOutVerdict(StrEnum):
    """The verdict of the held-out measurements."""

    PASS = "pass"  # noqa: S105 - a verdict, not a password
    OUT_OF_LIMITS = "out of limits"
    WORSE = "worse than before"
    NOT_EVALUATED = "not evaluated"


@dataclass(frozen=True, slots=True)
class DeviationStatistics:
    """Mean and largest distance of the ball from its point's reference, mm, over a number of poses."""

    mean_mm: float
    largest_mm: float
    poses: int

    @classmethod
    def of(cls, deviations: ArrayLike) -> DeviationStatistics | None:
        """Of deviations (n, 3), mm, without the references; none without any, or if one is not finite."""
        distances: Array = np.linalg.norm(np.reshape(np.asarray(deviations, dtype=float), (-1, 3)), axis=-1)
        if not len(distances) or not np.isfinite(distances).all():
            return None
        return cls(float(distances.mean()), float(distances.max()), len(distances))


def validate(
    before: DeviationStatistics | None,
    after: DeviationStatistics | None,
    *,
    mean_mm: float,
    largest_mm: float,
) -> HeldOutVerdict:
    """The verdict under limits on the mean and the largest distance, mm; missing data never pass."""
    if before is None or after is None:
        return HeldOutVerdict.NOT_EVALUATED
    if after.mean_mm > before.mean_mm:
        return HeldOutVerdict.WORSE
    within = after.mean_mm <= mean_mm and after.largest_mm <= largest_mm
    return HeldOutVerdict.PASS if within else HeldOutVerdict.OUT_OF_LIMITS


def calibration_outcome(
    counts: tuple[int, int, int],
    before: DeviationStatistics | None,
    after: DeviationStatistics | None,
    limit_mm: float,
    verdict: HeldOutVerdict,
) -> str:
    """The outcome of a calibration in one line: what was used, deviation before and after, verdict.

    ``counts`` are the numbers of free parameters, of records, and of points.
    """
    parameters, records, points = counts
    what = f"{parameters} parameters, {records} records at {points} points"
    if before is None or after is None:
        return f"{what}; held-out points: {verdict}"
    means = f"{before.mean_mm:.2f} -> {after.mean_mm:.3f} mm"
    return f"{what}; mean deviation at held-out points {means} (limit {limit_mm:g}): {verdict}"


def check_outcome(found: DeviationStatistics | None, limit_mm: float, verdict: HeldOutVerdict) -> str:
    """The outcome of a check in one line: deviation at the held-out points, verdict."""
    if found is None:
        return f"held-out points: {verdict}"
    return (
        f"{found.poses} poses at held-out points; mean deviation {found.mean_mm:.3f} mm "
        f"(limit {limit_mm:g}): {verdict}"
    )
