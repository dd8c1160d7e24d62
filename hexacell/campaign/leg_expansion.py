"""How much longer the legs were while measuring, by their temperatures."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.rotations import Array

UM_PER_M = 1e-6
"""A relative expansion."""


def leg_expansion(geometry: Geometry, um_per_m_k: float, warmer: Array) -> Array:
    """By how much the parameters (n, P) differ where legs are ``warmer`` (n, 6), K, than in a geometry."""
    parameters = geometry.parameters
    of_legs = np.array([one.kind.part is MachinePart.LEGS for one in parameters.parameters])
    legs = np.array([one.leg for one in parameters.parameters])
    by_kelvin = np.where(of_legs, UM_PER_M * um_per_m_k * geometry.vector, 0.0)
    expansion: Array = warmer[:, legs - 1] * by_kelvin
    return expansion
