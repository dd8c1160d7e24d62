"""Robots for studies: the drawing with random errors in every free parameter."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism


def random_robot(
    mechanism: Mechanism, drawing: Geometry, error_mm: float, random: np.random.Generator
) -> Geometry:
    """A geometry in the frame convention, each free parameter uniform within ``error_mm``.

    So were the errors of Table 1 of Abtahi et al. 2010 made (section 3.1, +-7 mm).
    """
    free = mechanism.convention.free_parameters(drawing)
    return Geometry.from_vector(
        mechanism.convention.basis() @ (free + random.uniform(-error_mm, error_mm, len(free)))
    )
