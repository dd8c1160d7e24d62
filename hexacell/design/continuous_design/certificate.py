"""The certificate of a design measure against all records that its points could have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.design.continuous_design.measure import DesignMeasure, PossibleRecords
from hexacell.design.continuous_design.optimality import Optimality
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class Linearization:
    """A criterion linearized at a design measure; see :mod:`.optimality`.

    Attributes:
        information: M (p, p), the prior's included.
        factor: G (p, r).
        centres: K (c, p) of each point.
        total: t.
        fixed: ``tr(G^T F G)`` of the prior and the fixed records F, with these centres.
        shares: k of each point, its fixed records not counted.
    """

    information: Array
    factor: Array
    centres: tuple[Array, ...]
    total: float
    fixed: float
    shares: tuple[float, ...]

    @classmethod
    def at(cls, design: DesignMeasure, optimality: Optimality) -> Linearization:
        """Of a criterion at a design."""
        information, centres = design.information()
        factor = optimality.factor(information)
        total, fixed = (float(np.sum(factor * (matrix @ factor))) for matrix in (information, design.prior))
        for point, centre in zip(design.points, centres, strict=True):
            fixed += float(point.fixed.sensitivities(centre, factor).sum())
        shares = tuple(point.share for point in design.points)
        return cls(information, factor, centres, total, fixed, shares)

    def sensitivities(self, point: int, records: PossibleRecords) -> Array:
        """Of some records (n,) at a point, counted from 0."""
        return records.sensitivities(self.centres[point], self.factor)

    def least_efficiency(self, largest: Sequence[float]) -> float:
        """The efficiency that the design has at least, by each point's largest sensitivity."""
        most = self.fixed + sum(k * s for k, s in zip(self.shares, largest, strict=True))
        return min(1.0, self.total / most)
