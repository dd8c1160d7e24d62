"""Parameters that were pushed beyond the drawing's tolerances.

A good residual is no proof: rods 13 mm too short have explained data perfectly before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics.geometry import PARAMETER_NAMES, Geometry
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
    change = found.geometry.vector() - drawing.vector()
    widths = tolerances.widths()
    within = np.abs(_without_ball(change, tolerances)) - CERTAIN_SIGMAS * found.sigma <= widths
    return tuple(
        ToleranceViolation(
            PARAMETER_NAMES[row], float(change[row]), float(widths[row]), float(found.sigma[row])
        )
        for row in np.flatnonzero(~within)
    )


def _without_ball(change: Array, tolerances: Tolerances) -> Array:
    """The change less the ball's own offset, as far as that is allowed."""
    B = change[18:36].reshape(6, 3)
    offset = np.clip(np.median(B, axis=0), -tolerances.ball_mm, tolerances.ball_mm)
    return np.concatenate([change[:18], (B - offset).ravel(), change[36:]])
