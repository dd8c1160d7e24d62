"""Play: the joints of a leg have clearance, and the leg is longer when it is pulled than when it is pushed.

The side on which a joint lies follows from the sign of the force, that of the platform's weight; how heavy
the platform is does not matter. Legs that are hardly loaded may lie on either side: the platform has
another place, at which they are pushed that were pulled, and keeps the place to which it came.
"""

from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np

from hexacell.identification.placement import Placement, Weight, leg_forces
from hexacell.identification.terms.term import ModelTerm, StatedMachine
from hexacell.kinematics.forward import apply_twist
from hexacell.kinematics.rotations import Array

WRONG_SIDE = float(np.sqrt(0.5))
"""Root mean square of an error that is as likely none as all of the play."""

HARDLY_LOADED = 0.01
"""Force of a leg, by a weight of one newton, of which nobody knows the sign."""


@cache
def every_side(legs: int) -> Array:
    """All sides on which so many legs may lie (2^J, J)."""
    return np.array(list(product((-1.0, 1.0), repeat=legs)))


def play(size_mm: float, weight: Weight) -> ModelTerm:
    """The play of each leg under a weight."""
    return ModelTerm(
        "play",
        "mm",
        size_mm,
        partial(_on_one_side, weight),
        shown_by="poses that pull and push each leg, little and much",
        on_either_side=partial(_on_either_side, weight),
        weight=weight,
        of_weight=partial(play, size_mm),
    )


def stated_play(machine: StatedMachine) -> ModelTerm:
    """The play that a cell file states."""
    return play(machine.sizes["play_mm"], machine.weight)


def _on_one_side(weight: Weight, placement: Placement, _directions: Array) -> Array:
    return np.asarray(-0.5 * np.sign(leg_forces(placement, weight)))


def _on_either_side(weight: Weight, placement: Placement, _directions: Array, sizes_mm: Array) -> Array:
    """The other places that the platform may have, each one cause (n, 6, k)."""
    forces = leg_forces(placement, weight)
    sides, may = _sides(forces), (np.abs(forces) < HARDLY_LOADED).any(axis=1)
    for one in placement.each_leg:
        alone = sides * np.where(one > 0.0, -1.0, 1.0)
        may |= (_sides_at(placement, sides, alone, sizes_mm, weight) != sides).any(axis=1)
    rows = np.flatnonzero(may).tolist()
    places = {row: _other_places(placement, row, forces[row], sizes_mm, weight) for row in rows}
    errors = np.zeros((*forces.shape, max(map(len, places.values()), default=0)))
    for row, others in places.items():
        errors[row, :, : len(others)] = (sides[row] - others).T
    return np.asarray(0.5 * WRONG_SIDE * errors * sizes_mm[:, None])


def _other_places(placement: Placement, row: int, forces: Array, sizes_mm: Array, weight: Weight) -> Array:
    """The sides of the legs (k, 6) where they balance too, and of each leg whose side is not known."""
    every = every_side(len(forces))
    rows, sides = np.full(len(every), row), np.tile(_sides(forces), (len(every), 1))
    at = replace(placement, poses=placement.poses[rows], joints=placement.joints[rows])
    is_balanced = (_sides_at(at, sides, every, sizes_mm, weight) == every).all(axis=1)
    unsure = np.abs(forces) < HARDLY_LOADED
    differ = sides != every
    is_other = is_balanced | (differ @ unsure & (differ.sum(axis=1) == 1))
    return np.asarray(every[is_other & differ.any(axis=1)])


def _sides_at(at: Placement, sides: Array, others: Array, sizes_mm: Array, weight: Weight) -> Array:
    """On which sides the legs would lie if they lay on ``others``, and not as now."""
    twists = 0.5 * at.by_legs(((sides - others) * sizes_mm)[..., None])
    moved = replace(at, poses=apply_twist(at.poses, twists[..., 0]))
    return _sides(leg_forces(moved, weight))


def _sides(forces: Array) -> Array:
    """1 of a leg that is pulled, -1 of one that is pushed."""
    return np.where(forces > 0.0, 1.0, -1.0)
