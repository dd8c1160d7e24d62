"""The best design measure on given possible records.

Only a few records have weight at a time (:mod:`.weights`): those of small weight are left out, and those of
the largest sensitivity come in, until the certificate says that nothing that is left is better by more than
a small share (Fedorov 1972; as column generation in convex programming).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hexacell.design.continuous_design.certificate import Linearization
from hexacell.design.continuous_design.measure import DesignMeasure, PossibleRecords
from hexacell.design.continuous_design.optimality import Optimality
from hexacell.design.continuous_design.weights import best_weights
from hexacell.kinematics.rotations import Array

SMALLEST_WEIGHT = 0.1
"""Of the wanted gap: a record with less than this share of its point's weight is left out."""

ADDED_PART = 0.2
"""Of a point's weight, which records that come in take."""

ADDED = 16
"""Records that come in at a point."""

MOST_ROUNDS = 60
SHARE_OF_GAP = 0.3
"""Of the wanted gap, to which the weights of a few records are brought."""


def best_measure(
    start: DesignMeasure, possible: Sequence[PossibleRecords], optimality: Optimality, gap: float
) -> tuple[DesignMeasure, float]:
    """The best measure on the start's records and each point's possible ones, and its certificate.

    Args:
        start: with as many records at each point as the best measure is to have.
        possible: of each point.
        optimality: what is best.
        gap: the share that may be missing from the best; the certificate is then at least ``1 - gap``.
    """
    design, certificate = start, 0.0
    for _ in range(MOST_ROUNDS):
        design = weighted(design, optimality, gap)
        at = Linearization.at(design, optimality)
        found = [at.sensitivities(point, records) for point, records in enumerate(possible)]
        certificate = at.least_efficiency(largest_sensitivities(at, design, found))
        if certificate >= 1.0 - gap:
            break
        best = [np.argsort(-one)[:ADDED] for one in found]
        design = with_more(design, [records[rows] for records, rows in zip(possible, best, strict=True)])
    return design, certificate


def weighted(design: DesignMeasure, optimality: Optimality, gap: float) -> DesignMeasure:
    """The design with the best weights on its own records, without those that have hardly any."""
    design = best_weights(design, optimality, SHARE_OF_GAP * gap)
    return replace(design, points=tuple(one.supported(SMALLEST_WEIGHT * gap) for one in design.points))


def with_more(design: DesignMeasure, more: Sequence[PossibleRecords]) -> DesignMeasure:
    """The design with more records at each point, which have some of its weight."""
    both = zip(design.points, more, strict=True)
    return replace(design, points=tuple(one.with_records(records, ADDED_PART) for one, records in both))


def largest_sensitivities(at: Linearization, design: DesignMeasure, found: Sequence[Array]) -> list[float]:
    """The largest of each point: of the design's own records, and of some found ones."""
    own = (at.sensitivities(point, one.records) for point, one in enumerate(design.points))
    return [
        max(float(ours.max(initial=0.0)), float(others.max(initial=0.0)))
        for ours, others in zip(own, found, strict=True)
    ]
