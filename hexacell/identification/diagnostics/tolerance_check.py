"""Parameters that were pushed beyond the drawing's tolerances.

A good residual is no proof: rods 13 mm too short have explained data perfectly before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array

CERTAIN_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class ToleranceViolation:
    """A parameter that is certainly not within its tolerance; mm.

    Attributes:
        change_mm: from the drawing, the ball's own offset included.
    """

    name: str
    change_mm: float
    tolerance_mm: float
    sigma_mm: float


def tolerance_violations(
    found: GeometryEstimate, drawing: Geometry, tolerances: Tolerances
) -> tuple[ToleranceViolation, ...]:
    """The parameters that, three sigma granted, are beyond their tolerance; not a number is beyond all."""
    parameters = drawing.parameters
    change = found.geometry.vector - drawing.vector
    widths = tolerances.widths(parameters)
    own = _without_ball_offset(change, parameters, tolerances.ball_mm)
    within = np.abs(own) - CERTAIN_SIGMAS * found.sigma <= widths
    return tuple(
        ToleranceViolation(
            parameters.names[row], float(change[row]), float(widths[row]), float(found.sigma[row])
        )
        for row in np.flatnonzero(~within)
    )


def _without_ball_offset(change: Array, parameters: ParameterSet, ball_mm: float) -> Array:
    """The change less the ball's offset: the median along each axis, as far as that is allowed."""
    medians = [np.median(change[axis > 0.0]) if axis.any() else 0.0 for axis in parameters.ball_offset]
    return change - np.clip(medians, -ball_mm, ball_mm) @ parameters.ball_offset
