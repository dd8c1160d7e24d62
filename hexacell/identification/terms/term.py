"""A term of the model beside the geometry: one coefficient a leg, and what it does at a record.

What a term does is an error of the legs' constraints, in mm of leg length, for each leg by its own
coefficient: a leg that is longer by d has the error -d. The pose follows by ``-J^-1`` as for all such
errors (:mod:`~hexacell.identification.placement`). Before records say more, the six coefficients
are known as a part that all legs share and a part of each of them, both normal with mean zero and the size
that is stated of the term.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from hexacell.identification.placement import Placement, Weight
from hexacell.kinematics.parameters import CONSTRAINTS, JointUnit
from hexacell.kinematics.rotations import Array

LegErrors = Callable[[Placement, Array], Array]
"""Errors of the constraints (n, 6), mm, by one unit of each leg's own coefficient, at n poses at which the
joints arrived from some directions (n, 6)."""

ErrorsOfSizes = Callable[[Placement, Array, Array], Array]
"""Likewise (n, 6, k) by each of k independent causes, for coefficients of some sizes (6,)."""


class Finding(StrEnum):
    """What the records say of a term."""

    TAKEN = "taken"
    KNOWN = "known from an earlier result"
    NOT_SHOWN = "not shown"
    NOT_PREDICTED = "does not predict the records of other points better"
    FAULTS = "faults of records explain them better"
    ONE_SIDE = "is the same at every stop, as all were reached from one side"
    NOT_DISTINCT = "cannot be told apart from another"


@dataclass(frozen=True, slots=True)
class TermFinding:
    """A term that was tried.

    Attributes:
        log_factor: logarithm of the Bayes factor, beside the terms that were taken before it.
        predicted: by how much the logarithm of the density of points' records, predicted from all other
            points, is higher with it; None where that was not asked.
        rival: the term that it cannot be told from.
        told_by: the records that would tell, in words.
    """

    name: str
    finding: Finding
    log_factor: float
    predicted: float | None = None
    rival: str = ""
    told_by: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class StatedMachine:
    """What a cell file states of which terms are made.

    Attributes:
        sizes: by the fields of ``[model]``; that of a plug-in's term, which may be absent, by its name.
        joint_unit: of the joint variables.
        weight: how that of the platform acts.
        newton: how heavy it is; 0 where that is not stated.
    """

    sizes: Mapping[str, float]
    joint_unit: JointUnit
    weight: Weight
    newton: float


@dataclass(frozen=True, slots=True, eq=False)
class ModelTerm:
    """A term of the model, of one kind for all legs.

    The file of a term has a function that makes it of a :class:`StatedMachine`, or None where that states
    too little, and is announced as an entry point of the group ``hexacell.terms``.

    Attributes:
        name: of the entry point, for people, and in documents; controllers correct those of
            :class:`.CorrectionKind`, and no others.
        unit: of its coefficients.
        size: one standard deviation, in its unit, of what a coefficient may be.
        leg_errors: what it does.
        takes_up: the effect of the uncertainty budget that it describes, by its name; empty for none.
        needs_directions: whether it acts by the side from which joints arrive.
        shown_by: the records that tell it from any other term, in words.
        on_either_side: the errors of legs that may have either sign, as nobody knows on which side they are
            there; None where that is always known.
        weight: under which it acts; None where that does not matter.
        of_weight: the same term under another weight.
        mean: coefficients (J,) as they are expected.
        sigma: one standard deviation of each (6,), where they were identified before; None: see ``size``.
    """

    name: str
    unit: str
    size: float
    leg_errors: LegErrors
    takes_up: str = ""
    needs_directions: bool = False
    shown_by: str = ""
    on_either_side: ErrorsOfSizes | None = None
    weight: Weight | None = None
    of_weight: "Callable[[Weight], ModelTerm] | None" = None
    mean: Array = field(default_factory=lambda: np.zeros(CONSTRAINTS))
    sigma: Array | None = None

    @property
    def spread(self) -> Array:
        """(6, k) coefficients by one standard deviation of each independent part."""
        if self.sigma is not None:
            return np.diag(self.sigma)
        legs = len(self.mean)
        return self.size * np.concatenate([np.ones((legs, 1)), np.eye(legs)], axis=1)

    def pose_errors(self, placement: Placement, directions: Array) -> Array:
        """Errors of the poses (n, 6, J), mm and rad, by one unit of each leg's coefficient."""
        errors = self.leg_errors(placement, directions)
        return np.asarray(placement.by_constraints[..., : errors.shape[1]] * errors[:, None, :])
