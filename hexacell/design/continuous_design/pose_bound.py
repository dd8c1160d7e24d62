"""The best design measure over all poses of some points: its bound, and its certificate.

Weights are given to some poses (:mod:`.weights`). Then poses all over each point's domain are looked at,
new ones each time, and the most sensitive of them are climbed: turned at random, by smaller and smaller
angles, wherever that makes them more sensitive. What is found comes in, until the certificate holds for the
climbed poses too. These show the maximum over a continuum, which no sample proves; `docs/measured.md` has
by how much independent samples exceeded it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.design.candidates import ReachableTargets, rows_apart
from hexacell.design.continuous_design.certificate import Linearization
from hexacell.design.continuous_design.measure import DesignMeasure
from hexacell.design.continuous_design.optimality import Optimality
from hexacell.design.continuous_design.pose_domain import PoseDomain
from hexacell.design.continuous_design.solver import largest_sensitivities, weighted, with_more
from hexacell.kinematics.rotations import Array

SPREAD = 2048
"""Poses all over a point's domain, of which the possible ones are looked at."""

CLIMBING = 24
"""Poses of a point whose sensitivity is climbed."""

ADDED = 12
"""The most sensitive of these come in."""

APART = np.radians(6.0)
"""Of poses that are climbed, in orientation."""

ANGLES = np.radians([16.0, 8.0, 8.0, 4.0, 4.0, 2.0, 2.0, 1.0, 1.0, 0.5])
MOST_CLIMBS = 14
ROUGHLY = 0.2
"""Share of what is missing, to which weights are brought as long as better poses are still found."""

GAP = 0.03
"""Share of the information by which a better measure may exceed the best one that was found."""


@dataclass(frozen=True, slots=True, eq=False)
class DesignBound:
    """The best measure that was found.

    Attributes:
        design: the measure.
        information: its information (p, p), the prior's included.
        certificate: its efficiency against any other measure is at least this.
    """

    design: DesignMeasure
    information: Array
    certificate: float


def design_bound(
    start: DesignMeasure, domains: Sequence[PoseDomain], optimality: Optimality, gap: float = GAP
) -> DesignBound:
    """The bound of all designs with the start's prior, fixed records and numbers of records."""
    random = np.random.default_rng(0)
    known: list[list[ReachableTargets]] = [[]] * len(domains)
    design, certificate = start, 0.0
    for climb in range(MOST_CLIMBS):
        design = weighted(design, optimality, max(gap, ROUGHLY * (1.0 - certificate)))
        at = Linearization.at(design, optimality)
        climbed = [
            _Climb(at, point, domain, random).climbed(
                ReachableTargets.concatenate([*known[point], domain.spread(SPREAD, climb)])
            )
            for point, domain in enumerate(domains)
        ]
        more = [domain.records(some) for domain, some in zip(domains, climbed, strict=True)]
        found = [at.sensitivities(point, records) for point, records in enumerate(more)]
        certificate = at.least_efficiency(largest_sensitivities(at, design, found))
        if certificate >= 1.0 - gap:
            break
        best = [np.argsort(-one)[:ADDED] for one in found]
        design = with_more(design, [records[rows] for records, rows in zip(more, best, strict=True)])
        known = [[some] for some in climbed]
    return DesignBound(design, design.information()[0], certificate)


@dataclass(frozen=True, slots=True, eq=False)
class _Climb:
    """Of the sensitivity of a point's poses."""

    at: Linearization
    point: int
    domain: PoseDomain
    random: np.random.Generator

    def climbed(self, targets: ReachableTargets) -> ReachableTargets:
        """The most sensitive of some poses, turned to where they are more so."""
        values = self._sensitivities(targets)
        best = rows_apart(targets.poses.rotations, np.argsort(-values), CLIMBING, APART)
        present, values = targets[best], values[best]
        for angle in ANGLES:
            turned, rows = self.domain.possible_rows(self.domain.around(present, angle, self.random))
            found = self._sensitivities(turned)
            better = found > values[rows]
            present = _replaced(present, rows[better], turned[better])
            values[rows[better]] = found[better]
        return present

    def _sensitivities(self, targets: ReachableTargets) -> Array:
        return self.at.sensitivities(self.point, self.domain.records(targets))


def _replaced(
    targets: ReachableTargets, rows: NDArray[np.intp], others: ReachableTargets
) -> ReachableTargets:
    joints = targets.joints.copy()
    joints[rows] = others.joints
    return ReachableTargets(targets.poses.with_rows(rows, others.poses), joints)
