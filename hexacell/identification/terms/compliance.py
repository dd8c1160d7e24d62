"""Compliance: each leg with its joints yields in proportion to its force, that of a known weight."""

from functools import partial

import numpy as np

from hexacell.identification.placement import Placement, leg_forces
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.rotations import Array

UM = 1e-3
"""A micrometre in mm."""


def compliance(
    size_um_n: float, newton: float, direction: Array, centre_mm: Array | None = None
) -> ModelTerm:
    """The compliance of each leg, um/N, under a weight; for the others see :func:`.leg_forces`."""
    yielding = partial(_yielding, newton, direction, centre_mm)
    return ModelTerm("compliance", "um/N", size_um_n, yielding, takes_up="own weight")


def _yielding(
    newton: float, direction: Array, centre_mm: Array | None, placement: Placement, _directions: Array
) -> Array:
    return np.asarray(-UM * newton * leg_forces(placement, direction, centre_mm))
