"""Tolerance check: identified parameters outside the drawing's tolerances.

Small residuals do not prove a geometry: legs 13 mm too short can explain data perfectly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array

SIGNIFICANT_SIGMAS = 3.0


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
