"""Play: the joints of a leg have clearance, and the leg is longer when it is pulled than when it is pushed.

The side on which a joint lies follows from the sign of the force, that of the platform's weight; how heavy
the platform is does not matter. A leg that is hardly pulled or pushed may lie on either side: each side may
bring the platform to where the force keeps it there.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from hexacell.identification.placement import Placement, leg_forces
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.forward import apply_twist
from hexacell.kinematics.parameters import LEGS
from hexacell.kinematics.rotations import Array

WRONG_SIDE = float(np.sqrt(0.5))
"""Root mean square of an error that is as likely none as all of the play."""


def play(size_mm: float, direction: Array, centre_mm: Array | None = None) -> ModelTerm:
    """The play of each leg; where and whereto the weight acts as in :func:`.leg_forces`."""
    acts = direction, centre_mm
    return ModelTerm(
        "play", "mm", size_mm, partial(_on_one_side, *acts), on_either_side=partial(_on_either_side, *acts)
    )


def _on_one_side(
    direction: Array, centre_mm: Array | None, placement: Placement, _directions: Array
) -> Array:
    return np.asarray(-0.5 * np.sign(leg_forces(placement, direction, centre_mm)))


def _on_either_side(
    direction: Array, centre_mm: Array | None, placement: Placement, _directions: Array, sizes_mm: Array
) -> Array:
    pulls = leg_forces(placement, direction, centre_mm) > 0.0
    either = np.zeros_like(pulls)
    for leg in range(LEGS):
        for longer_mm in (-sizes_mm[leg], sizes_mm[leg]):
            moved = apply_twist(placement.poses, longer_mm * placement.by_constraints[:, :, leg])
            there = leg_forces(replace(placement, poses=moved), direction, centre_mm)
            either[:, leg] |= (there[:, leg] > 0.0) != pulls[:, leg]
    return np.asarray(WRONG_SIDE * either * sizes_mm)
