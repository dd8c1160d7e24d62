"""How the free parameters change with those of a machine described in any frames."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.rotations import Array

STEP = 1e-4
"""Of the differences, mm or rad: the change of frames is nearly linear over it."""


def free_parameter_derivatives(mechanism: Mechanism, geometry: Geometry) -> Array:
    """Derivatives (P, p) of the free parameters by all parameters of a geometry, in frames of its own.

    A parameter that the frame convention fixes moves the frames, and with them the others.
    """
    convention, vector = mechanism.convention, geometry.vector

    def free(values: Array) -> Array:
        normal, _ = mechanism.normalize_frames(Geometry(mechanism.parameters, values))
        return convention.free_parameters(normal)

    steps = STEP * np.eye(len(vector))
    return np.array([(free(vector + step) - free(vector - step)) / (2.0 * STEP) for step in steps])
