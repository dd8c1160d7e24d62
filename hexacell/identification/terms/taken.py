"""The terms that an identification has, with what they do to each of its records."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.placement import RecordPlacement
from hexacell.identification.terms.term import CAUSES, ModelTerm
from hexacell.kinematics.parameters import LEGS
from hexacell.kinematics.rotations import Array, Mask


@dataclass(frozen=True, slots=True, eq=False)
class TakenTerms:
    """Terms of the model at n records.

    Attributes:
        columns: (n, 3, k), mm: where the ball is by one standard deviation of each independent part of the
            coefficients of all terms.
    """

    terms: tuple[ModelTerm, ...]
    columns: Array

    @classmethod
    def of(cls, terms: tuple[ModelTerm, ...], records: RecordPlacement, known: Mask) -> TakenTerms:
        """The terms at records, whose poses are ``known`` (n,); at the others they do nothing."""
        parts = [
            term.pose_errors(records, records.directions)[:, :3] @ term.spread
            if known.all()
            else _at_some(term, records, known)
            for term in terms
        ]
        return cls(terms, np.concatenate([np.zeros((len(records), 3, 0)), *parts], axis=-1))

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> TakenTerms:
        return replace(self, columns=self.columns[rows])

    def joined(self, other: TakenTerms) -> TakenTerms:
        """The same terms at both sets of records."""
        return replace(self, columns=np.concatenate([self.columns, other.columns]))

    @property
    def spread(self) -> Array:
        """(6 m, k) coefficients of all m terms by one standard deviation of each independent part."""
        every = np.zeros((LEGS * len(self.terms), CAUSES * len(self.terms)))
        for row, term in enumerate(self.terms):
            every[row * LEGS : (row + 1) * LEGS, row * CAUSES : (row + 1) * CAUSES] = term.spread
        return every


def _at_some(term: ModelTerm, records: RecordPlacement, known: Mask) -> Array:
    columns = np.zeros((len(records), 3, CAUSES))
    some = replace(
        records,
        poses=records.poses[known],
        joints=records.joints[known],
        deviations=records.deviations[known],
        directions=records.directions[known],
    )
    columns[known] = term.pose_errors(some, some.directions)[:, :3] @ term.spread
    return columns
