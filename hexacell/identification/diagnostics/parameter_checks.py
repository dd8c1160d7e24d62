"""Checks of the identified parameters: strong correlations, and values outside the drawing's tolerances.

With a correlation near 1 or -1, the difference or sum of two parameters is known well and each parameter
poorly. The geometry may still be accurate, but a change identified in one of the two may be a change
of the other. Small residuals do not prove a geometry: legs 13 mm too short can explain data perfectly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate, Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array

STRONG = 0.9
SIGNIFICANT_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class CorrelatedPair:
    """The names of two free parameters, e.g. ``l3`` and ``B3z``, and their correlation."""

    first: str
    second: str
    correlation: float


def strongly_correlated(found: Identification, above: float = STRONG) -> tuple[CorrelatedPair, ...]:
    """Pairs of free parameters with an absolute correlation above ``above``, the strongest first."""
    names = found.problem.mechanism.convention.free_names()
    sigma = np.sqrt(np.diag(found.free_covariance))
    correlation = found.free_covariance / np.outer(sigma, sigma)
    rows, columns = np.triu_indices(len(names), 1)
    strengths = np.abs(correlation[rows, columns])
    order = np.argsort(-strengths, kind="stable")
    return tuple(
        CorrelatedPair(names[i], names[j], float(correlation[i, j]))
        for i, j in zip(rows[order], columns[order], strict=True)
        if abs(correlation[i, j]) > above
    )


@dataclass(frozen=True, slots=True)
class ToleranceViolation:
    """A parameter that is significantly outside its tolerance; mm.

    Attributes:
        change_mm: from the drawing, the ball's offset included.
    """

    name: str
    change_mm: float
    tolerance_mm: float
    sigma_mm: float


def tolerance_violations(
    found: GeometryEstimate, drawing: Geometry, tolerances: Tolerances
) -> tuple[ToleranceViolation, ...]:
    """The parameters outside their tolerance by more than three sigma. NaN counts as outside."""
    parameters = drawing.parameters
    change = found.geometry.vector - drawing.vector
    widths = tolerances.widths(parameters)
    own = _without_ball_offset(change, parameters, tolerances.ball_mm)
    within = np.abs(own) - SIGNIFICANT_SIGMAS * found.sigma <= widths
    return tuple(
        ToleranceViolation(
            parameters.names[row], float(change[row]), float(widths[row]), float(found.sigma[row])
        )
        for row in np.flatnonzero(~within)
    )


def _without_ball_offset(change: Array, parameters: ParameterSet, ball_mm: float) -> Array:
    """The change minus the ball's offset: the median along each axis, limited to the tolerance."""
    medians = [np.median(change[axis > 0.0]) if axis.any() else 0.0 for axis in parameters.ball_offset]
    return change - np.clip(medians, -ball_mm, ball_mm) @ parameters.ball_offset
