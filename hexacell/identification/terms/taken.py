"""The terms that an identification has, with what they do to each of its records."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.placement import RecordPlacement
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.rotations import Array, Mask

SWEEPS = 4
"""Forces by the pose, and the pose by forces, in turn."""


@dataclass(frozen=True, slots=True, eq=False)
class TakenTerms:
    """Terms of the model at n records.

    Attributes:
        columns: (n, 3, k), mm: where the ball is by one standard deviation of each independent part of the
            coefficients of all terms.
        offset: (n, 3), mm: where it is by the coefficients that are expected.
        unknown: (n, 6) variance of where joints are, or seem to be, as nobody knows on which side they are.
    """

    terms: tuple[ModelTerm, ...]
    columns: Array
    offset: Array
    unknown: Array

    @classmethod
    def of(
        cls,
        terms: tuple[ModelTerm, ...],
        records: RecordPlacement,
        known: Mask,
        values: Array | None = None,
    ) -> TakenTerms:
        """The terms at records, whose poses are ``known`` (n,); at the others they do nothing.

        What they do is linearized at coefficients of some ``values`` (6 m,), by default at none.
        """
        some = replace(
            records,
            poses=records.poses[known],
            joints=records.joints[known],
            deviations=records.deviations[known],
            directions=records.directions[known],
        )
        mean = mean_of(terms)
        legs = records.joints.shape[1]
        by_coefficients = np.zeros((len(records), 3, legs * len(terms)))
        offset = np.zeros((len(records), 3))
        if values is not None:
            positions, some = some.poses.positions, deformed(terms, some, values)
            offset[known], mean = some.poses.positions - positions, mean - values
        for row, term in enumerate(terms):
            columns = slice(row * legs, (row + 1) * legs)
            by_coefficients[known, :, columns] = term.pose_errors(some, some.directions)[:, :3]
        unknown = np.zeros_like(records.joints)
        unknown[known] = _unknown_places(terms, some, values)
        return cls(terms, by_coefficients @ spread_of(terms), offset + by_coefficients @ mean, unknown)

    def __getitem__(self, rows: Mask | NDArray[np.intp]) -> TakenTerms:
        return TakenTerms(self.terms, self.columns[rows], self.offset[rows], self.unknown[rows])

    def joined(self, other: TakenTerms) -> TakenTerms:
        """These terms at both sets of records."""
        mine = self.columns, self.offset, self.unknown
        others = other.columns, other.offset, other.unknown
        return TakenTerms(self.terms, *map(np.concatenate, zip(mine, others, strict=True)))


def _unknown_places(terms: tuple[ModelTerm, ...], records: RecordPlacement, values: Array | None) -> Array:
    """Variance (n, 6) of joints that may be on either side, by coefficients of some values (6 m,)."""
    variance, legs = np.zeros_like(records.joints), records.joints.shape[1]
    for row, term in enumerate(terms):
        if term.on_either_side is not None:
            size = term.mean if values is None else values[row * legs : (row + 1) * legs]
            squares = np.sum(term.on_either_side(records, records.directions, size) ** 2, axis=-1)
            variance = variance + records.as_joints(np.sqrt(squares)) ** 2
    return variance


def deformed(terms: tuple[ModelTerm, ...], records: RecordPlacement, values: Array) -> RecordPlacement:
    """Records where terms of some coefficients (6 m,) bring the platform, and joints that would do that.

    Forces are those where it is then: a compliant leg yields a little more for what it has yielded. Where
    no such pose is found it stays.
    """
    at, legs = records, records.joints.shape[1]
    for _ in range(SWEEPS):
        errors = np.zeros_like(records.joints)
        for row, term in enumerate(terms):
            coefficients = values[row * legs : (row + 1) * legs]
            errors = errors + term.leg_errors(at, records.directions) * coefficients
        joints = records.joints + records.as_joints(errors)
        solved = forward_kinematics(records.mechanism, records.geometry, joints, records.poses)
        kept = solved.found
        poses = records.poses.with_rows(kept, solved.poses[kept])
        at = replace(records, poses=poses, joints=np.where(kept[:, None], joints, records.joints))
    return at


def mean_of(terms: tuple[ModelTerm, ...]) -> Array:
    """(6 m,) coefficients of all m terms as they are expected."""
    return np.concatenate([np.zeros(0), *(term.mean for term in terms)])


def spread_of(terms: tuple[ModelTerm, ...]) -> Array:
    """(6 m, k) coefficients of all m terms by one standard deviation of each independent part."""
    parts = [term.spread for term in terms]
    every = np.zeros((sum(len(part) for part in parts), sum(part.shape[1] for part in parts)))
    row = column = 0
    for part in parts:
        every[row : row + len(part), column : column + part.shape[1]] = part
        row, column = row + len(part), column + part.shape[1]
    return every
