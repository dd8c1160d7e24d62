"""Compliance: each leg with its joints yields in proportion to its force, that of a known weight."""

from functools import partial

import numpy as np

from hexacell.identification.placement import Placement, Weight, leg_forces
from hexacell.identification.terms.term import ModelTerm, StatedMachine
from hexacell.kinematics.rotations import Array

UM = 1e-3
"""A micrometre in mm."""


def compliance(size_um_n: float, newton: float, weight: Weight) -> ModelTerm:
    """The compliance of each leg, um/N, under a weight of so many newtons."""
    return ModelTerm(
        "compliance",
        "um/N",
        size_um_n,
        partial(_yielding, newton, weight),
        takes_up="own weight",
        shown_by="records under another known weight",
        weight=weight,
        of_weight=partial(compliance, size_um_n, newton),
    )


def stated_compliance(machine: StatedMachine) -> ModelTerm | None:
    """The compliance that a cell file states; None of a weight that it does not state."""
    size = machine.sizes["compliance_um_n"]
    return compliance(size, machine.newton, machine.weight) if machine.newton else None


def _yielding(newton: float, weight: Weight, placement: Placement, _directions: Array) -> Array:
    return np.asarray(-UM * newton * leg_forces(placement, weight))
