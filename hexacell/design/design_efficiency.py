"""The efficiency of a campaign: its information beside that of the best design under the same limits.

Compared are the records that were taken with the best continuous design (:mod:`.continuous_design`) for
the same points, references, numbers of records, noise and prior, whose other poses a designer chose who
knew the robot beforehand. The robot is that of the estimate. What is not known of the gauges' alignment
and scale lessens the records' information, and not the best design's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.design.candidates import ReachableTargets
from hexacell.design.continuous_design.measure import DesignMeasure, PointMeasure
from hexacell.design.continuous_design.optimality import DOptimality, IOptimality, Optimality
from hexacell.design.continuous_design.pose_bound import GAP, DesignBound, design_bound
from hexacell.design.continuous_design.pose_domain import PoseDomain
from hexacell.design.predicted_records import gauge_zero_at
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Array

D_GAP = 0.005
"""Share by which a measure for D may exceed the best one found: this takes little longer than 0.03."""

REFERENCES = 1
"""Records of a point that every design has."""


@dataclass(frozen=True, slots=True)
class Efficiency:
    """The share of the records with which the best design would know as much.

    Attributes:
        value: against the best measure that was found.
        certificate: of that measure; against any measure the share is at least the product.
    """

    value: float
    certificate: float

    @property
    def certified(self) -> float:
        """What the share is at least."""
        return self.value * self.certificate


@dataclass(frozen=True, slots=True)
class DesignEfficiency:
    """Of a campaign: of the volume of the confidence ellipsoid (D), and of the task's mean variance (I).

    ``i`` is none where the robot can take no task pose.
    """

    d: Efficiency
    i: Efficiency | None

    @property
    def certificate(self) -> float:
        """The smaller of both certificates."""
        return self.d.certificate if self.i is None else min(self.d.certificate, self.i.certificate)


def design_efficiency(
    belief: RobotBelief, found: Identification, predictions: Array | None = None
) -> DesignEfficiency:
    """Of the records of an identification.

    Args:
        belief: by this identification.
        found: the identification.
        predictions: derivatives (r, p) of the positions at the task poses, mm.
    """
    campaign = CampaignMeasure.of(belief, found)
    best = campaign.bound(DOptimality(), D_GAP)
    by_d = campaign.efficiency(DOptimality(), best)
    if predictions is None:
        return DesignEfficiency(by_d, None)
    of_task = IOptimality(predictions)
    near = replace(campaign, design=best.design)  # the search starts from what is good already
    return DesignEfficiency(by_d, campaign.efficiency(of_task, near.bound(of_task)))


@dataclass(frozen=True, slots=True, eq=False)
class CampaignMeasure:
    """A campaign as a design, the domains of its points, and its information (p, p), prior included."""

    design: DesignMeasure
    domains: tuple[PoseDomain, ...]
    information: Array

    @classmethod
    def of(cls, belief: RobotBelief, found: Identification) -> CampaignMeasure:
        """Of the records of an identification."""
        problem, domains, points = found.problem, [], []
        for point in np.unique(problem.labels[:, 0]).tolist():
            rows = np.flatnonzero(problem.labels[:, 0] == point)
            domain = PoseDomain(belief, gauge_zero_at(belief, found, int(point)))
            records = domain.records(ReachableTargets(found.poses[rows], problem.joints[rows]))
            domains.append(domain)
            points.append(PointMeasure.of_campaign(records, REFERENCES))
        precision = problem.prior.precision
        information = found.solution.information + precision
        return cls(DesignMeasure(tuple(points), precision), tuple(domains), information)

    def bound(self, optimality: Optimality, gap: float = GAP) -> DesignBound:
        """The best design under the same limits; a better one exceeds it by at most a share."""
        return design_bound(self.design, self.domains, optimality, gap)

    def efficiency(self, optimality: Optimality, bound: DesignBound) -> Efficiency:
        """By a criterion, against a bound."""
        return Efficiency(optimality.efficiency(self.information, bound.information), bound.certificate)
