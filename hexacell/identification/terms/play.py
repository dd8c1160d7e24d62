"""Play: the joints of a leg have clearance, and the leg is longer when it is pulled than when it is pushed.

The side on which a joint lies follows from the sign of the force, that of the platform's weight; how heavy
the platform is does not matter.
"""

import numpy as np

from hexacell.identification.placement import Placement, leg_forces
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.rotations import Array


def play(size_mm: float, direction: Array, centre_mm: Array | None = None) -> ModelTerm:
    """The play of each leg; where and whereto the weight acts as in :func:`.leg_forces`."""

    def on_one_side(placement: Placement, _directions: Array) -> Array:
        return np.asarray(-0.5 * np.sign(leg_forces(placement, direction, centre_mm)))

    return ModelTerm("play", "mm", size_mm, on_one_side)
