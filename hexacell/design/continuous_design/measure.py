"""Design measures: how much of its records a point has in each pose, and the information that gives.

Records are whitened: a record of covariance V, with ``R^T R = V^-1``, has the rows

    R (y - Z c - J p) = noise of unit covariance,

where c are constants of its point alone (where the ball was when the gauges were zeroed: Z is the
identity), and p the parameters. A measure gives each of n possible records a weight w >= 0; those of a
point add up to its number of records. With whole numbers it is a campaign; with any it is a continuous
(approximate) design (Kiefer 1959; Fedorov, Theory of Optimal Experiments, 1972). Its information on p,
whatever the constants are, is the Schur complement

    M = sum w (J - Z K)^T V^-1 (J - Z K),      K = (sum w Z^T V^-1 Z)^-1 sum w Z^T V^-1 J:

that of the records less their weighted mean over the point. The reference of a point is one of them.
Every other K gives a larger matrix (in the sense of Loewner): M is the least of linear functions of w,
so that it is concave in w.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.kinematics.rotations import Array, Mask


@dataclass(frozen=True, slots=True, eq=False)
class PossibleRecords:
    """Records (n) of a coordinates each.

    Attributes:
        rows: (n, a, c + p): by the constants of their point, then by the parameters.
        constants: how many of these there are, c.
    """

    rows: Array
    constants: int

    @classmethod
    def of(cls, jacobian: Array, weights: Array) -> PossibleRecords:
        """Records of positions, each but for its point's constant.

        Args:
            jacobian: by the parameters (n, a, p).
            weights: inverse covariances (n, a, a).
        """
        factor = np.swapaxes(np.linalg.cholesky(weights), -1, -2)
        return cls(np.concatenate([factor, factor @ jacobian], axis=-1), jacobian.shape[1])

    @classmethod
    def concatenate(cls, parts: Iterable[PossibleRecords]) -> PossibleRecords:
        """All of them, of one point."""
        parts = list(parts)
        return cls(np.concatenate([part.rows for part in parts]), parts[0].constants)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, rows: slice | Mask | NDArray[np.intp]) -> PossibleRecords:
        return PossibleRecords(self.rows[rows], self.constants)

    def normal(self, weights: Array | None = None) -> Array:
        """Normal matrix (c + p, c + p) of the records, with weights (n,)."""
        coordinates, columns = self.rows.shape[1:]
        flat = self.rows.reshape(-1, columns)
        weighted = flat if weights is None else flat * weights.repeat(coordinates)[:, None]
        normal: Array = flat.T @ weighted
        return normal

    def sensitivities(self, centre: Array, factor: Array) -> Array:
        """``tr(G^T (J - Z K)^T V^-1 (J - Z K) G)`` of each record (n,): the derivative by its weight.

        Args:
            centre: K (c, p).
            factor: G (p, r).
        """
        squares = self.centred(centre, factor) ** 2
        return squares.reshape(len(self), -1).sum(axis=-1) if len(self) else np.zeros(0)

    def centred(self, centre: Array, factor: Array) -> Array:
        """``R (J - Z K) G`` (n, a, r)."""
        by_all = np.concatenate([-centre @ factor, factor])
        centred: Array = self.rows @ by_all
        return centred


@dataclass(frozen=True, slots=True, eq=False)
class PointMeasure:
    """The measure of one point.

    Attributes:
        fixed: records that it has in any case, such as its reference.
        records: possible ones (n) beside them.
        weights: how much it has of these (n,).
    """

    fixed: PossibleRecords
    records: PossibleRecords
    weights: Array

    @classmethod
    def of_campaign(cls, records: PossibleRecords, fixed: int) -> PointMeasure:
        """Of records as they were taken, of which the first ones are fixed."""
        return cls(records[:fixed], records[fixed:], np.ones(len(records) - fixed))

    @property
    def share(self) -> float:
        """How many records the point has beside the fixed ones."""
        return float(self.weights.sum())

    def supported(self, smallest: float) -> PointMeasure:
        """The same without records of less than a share of its weight, the others taking theirs."""
        if not self.share:
            return self
        kept = self.weights >= smallest * self.share
        weights = self.weights[kept]
        return replace(self, records=self.records[kept], weights=weights * self.share / weights.sum())

    def with_records(self, records: PossibleRecords, part: float) -> PointMeasure:
        """With more possible records, which take a part of all weight in equal shares.

        Those that it has already are left out, and all of them if it has fixed records only.
        """
        if not self.share:
            return self
        is_known = (records.rows[:, None] == self.records.rows[None]).all(axis=(-2, -1)).any(axis=-1)
        records = records[~is_known]
        added = np.full(len(records), part * self.share / max(1, len(records)))
        weights = np.concatenate([(1.0 - part) * self.weights, added]) if len(records) else self.weights
        return replace(self, records=PossibleRecords.concatenate([self.records, records]), weights=weights)

    def information(self) -> tuple[Array, Array]:
        """The information M (p, p) on the parameters, and the centre K (c, p)."""
        c = self.fixed.constants
        normal = self.fixed.normal() + self.records.normal(self.weights)
        by_both = normal[:c, c:]
        centre = np.linalg.solve(normal[:c, :c], by_both)
        return normal[c:, c:] - by_both.T @ centre, centre


@dataclass(frozen=True, slots=True, eq=False)
class DesignMeasure:
    """The measures of all points, beside what is known before.

    Attributes:
        points: theirs.
        prior: information (p, p) beside that of the records.
    """

    points: tuple[PointMeasure, ...]
    prior: Array

    def information(self) -> tuple[Array, tuple[Array, ...]]:
        """The information (p, p) of all, the prior included, and each point's centre."""
        parts = [point.information() for point in self.points]
        total = self.prior + sum(information for information, _ in parts)
        return 0.5 * (total + total.T), tuple(centre for _, centre in parts)
