"""The best continuous design for a robot that is known beforehand, and how near a campaign comes to it.

A design gives each possible record of a point a weight w >= 0; those of a point add up to its number of
records. Records are whitened: one of covariance V, with ``R^T R = V^-1``, has the rows ``R (y - z - J p)``,
where z, the ball's place at the gauges' zero, is a constant of its point. With z eliminated, the
information on the parameters p is

    M = prior + sum over points of sum w (J - K)^T V^-1 (J - K),    K = (sum w V^-1)^-1 sum w V^-1 J.

Criteria are D, the volume of the confidence ellipsoid, and I, the mean variance of predictions. With
``G G^T = M^-1`` for D, and ``G`` the covariance times the predictions for I, the derivative by the weight
of a record is its sensitivity ``s = |R (J - K) G|^2``. No other design is better by more than ``g / t``,
with ``t = tr(G^T M G)`` and ``g`` what t would be if each point had its most sensitive record alone
(equivalence theorem: Kiefer and Wolfowitz 1960; bounds: Atwood 1969). `docs/method.md` has the derivation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from hexacell.design.candidates import ReachableTargets, reachable_targets, rows_apart
from hexacell.design.predicted_records import GaugeZero, gauge_zero_at, position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.result import Identification
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array

SPREAD, CLIMBING, ADDED = 2048, 24, 12
"""Poses of a point that are looked at; those of them that are climbed; those that come in."""
CLIMBING_APART = np.radians(6.0)
CLIMBS = np.radians([16.0, 8.0, 8.0, 4.0, 4.0, 2.0, 2.0, 1.0, 1.0, 0.5])
MOST_ROUNDS, MOST_STEPS = 40, 40
ADDED_PART = 0.2
"""Of a point's weight, which records that come in take."""
CENTRING, TO_THE_EDGE = 0.15, 0.9


def whitened(jacobian: Array, weights: Array) -> Array:
    """Rows (n, a, a + p) of records with derivatives (n, a, p) and inverse covariances (n, a, a)."""
    root = np.swapaxes(np.linalg.cholesky(weights), -1, -2)
    return np.concatenate([root, root @ jacobian], axis=-1)


def inverse_root(matrix: Array) -> Array:
    """A root (p, p) of the inverse of a matrix (p, p): H with ``H H^T`` the inverse."""
    root: Array = np.linalg.inv(np.linalg.cholesky(matrix)).T
    return root


@dataclass(frozen=True, eq=False)
class PointDesign:
    """A point's fixed records, its possible ones (n, a, a + p), and the weights of these (n,)."""

    fixed: Array
    records: Array
    weights: Array

    def normal(self) -> Array:
        """Normal matrix (a + p, a + p) of the zero and the parameters."""
        columns = self.records.shape[-1]
        fixed, records = self.fixed.reshape(-1, columns), self.records.reshape(-1, columns)
        return fixed.T @ fixed + (records.T * self.weights.repeat(self.records.shape[1])) @ records

    def information(self) -> tuple[Array, Array]:
        """The information (p, p) on the parameters, and the centre K (a, p)."""
        normal, a = self.normal(), self.records.shape[1]
        centre = np.linalg.solve(normal[:a, :a], normal[:a, a:])
        return normal[a:, a:] - normal[:a, a:].T @ centre, centre

    def supported(self, smallest: float) -> PointDesign:
        """Without records of less than a share of the point's weight."""
        kept = self.weights >= smallest * self.weights.sum()
        weights = self.weights[kept] * self.weights.sum() / max(self.weights[kept].sum(), 1e-300)
        return replace(self, records=self.records[kept], weights=weights)

    def with_records(self, records: Array) -> PointDesign:
        """With more possible records, which take a part of the weight; those that it has are left out."""
        known = (records[:, None] == self.records[None]).all(axis=(-2, -1)).any(axis=-1)
        added = records[~known]
        if not len(added) or not len(self.weights):
            return self
        each = ADDED_PART * self.weights.sum() / len(added)
        weights = np.concatenate([(1.0 - ADDED_PART) * self.weights, np.full(len(added), each)])
        return replace(self, records=np.concatenate([self.records, added]), weights=weights)


@dataclass(frozen=True, eq=False)
class Design:
    """The designs of all points, and the information (p, p) of the prior."""

    points: tuple[PointDesign, ...]
    prior: Array

    def information(self) -> tuple[Array, list[Array]]:
        """The information (p, p), the prior's included, and the centre of each point."""
        parts = [point.information() for point in self.points]
        total = self.prior + sum(information for information, _ in parts)
        return 0.5 * (total + total.T), [centre for _, centre in parts]


@dataclass(frozen=True, eq=False)
class Criterion:
    """D, or with derivatives (r, p) of predictions I."""

    predictions: Array | None = None

    def factor(self, information: Array) -> Array:
        """G (p, r) at an information (p, p)."""
        if self.predictions is None:
            return inverse_root(information)
        factor: Array = np.linalg.solve(information, self.predictions.T)
        return factor

    def efficiency(self, information: Array, best: Array) -> float:
        """The share of its records with which a better design knows as much."""
        if self.predictions is None:
            difference = np.linalg.slogdet(information)[1] - np.linalg.slogdet(best)[1]
            return float(np.exp(difference / len(information)))
        ours, theirs = (np.sum(self.predictions.T * self.factor(one)) for one in (information, best))
        return float(theirs / ours)


@dataclass(frozen=True, eq=False)
class Slopes:
    """A criterion linearized at a design."""

    design: Design
    information: Array
    centres: list[Array]
    factor: Array

    @classmethod
    def at(cls, design: Design, criterion: Criterion) -> Slopes:
        information, centres = design.information()
        return cls(design, information, centres, criterion.factor(information))

    def centred(self, point: int, records: Array, factor: Array) -> Array:
        """``R (J - K) G`` (n, a, r) of some records at a point."""
        centred: Array = records @ np.concatenate([-self.centres[point] @ factor, factor])
        return centred

    def sensitivities(self, point: int, records: Array) -> Array:
        """Derivatives (n,) of the criterion by the weights of some records at a point."""
        slopes: Array = (self.centred(point, records, self.factor) ** 2).sum(axis=(-2, -1))
        return slopes

    def certificate(self, others: Sequence[Array] = ()) -> float:
        """The efficiency that the design has at least against designs of its own and other records."""
        total, most = (
            float(np.sum(self.factor * (matrix @ self.factor)))
            for matrix in (self.information, self.design.prior)
        )
        for point, one in enumerate(self.design.points):
            records = [one.records, *(others[point : point + 1])]
            largest = max(float(self.sensitivities(point, some).max(initial=0.0)) for some in records)
            most += float(self.sensitivities(point, one.fixed).sum()) + one.weights.sum() * largest
        return min(1.0, total / most)


def best_weights(design: Design, criterion: Criterion, gap: float) -> Design:
    """The design with the best weights on its own records, up to a gap of the certificate on these.

    A primal-dual interior-point method (Boyd and Vandenberghe, Convex Optimization, 2004, 11.7).
    """
    labels = np.repeat(np.arange(len(design.points)), [len(one.weights) for one in design.points])
    sums = (labels[:, None] == np.unique(labels)).astype(float)
    multipliers: Array | None = None
    for _ in range(MOST_STEPS):
        at = Slopes.at(design, criterion)
        if at.certificate() >= 1.0 - gap:
            break
        weights = np.concatenate([one.weights for one in design.points])
        slopes = np.concatenate([at.sensitivities(i, one.records) for i, one in enumerate(design.points)])
        if multipliers is None:
            total = float(np.sum(at.factor * (at.information @ at.factor)))
            multipliers = total / weights / len(weights)
        target = CENTRING * float(weights @ multipliers) / len(weights)
        hessian = _second_derivatives(at, criterion) + np.diag(multipliers / weights)
        solved = np.linalg.solve(hessian, np.column_stack([slopes + target / weights, sums]))
        common = np.linalg.solve(sums.T @ solved[:, 1:], sums.T @ solved[:, 0])
        step = solved[:, 0] - solved[:, 1:] @ common
        values = np.concatenate([weights, multipliers])
        steps = np.concatenate([step, target / weights - multipliers - multipliers / weights * step])
        falling = steps < 0.0
        length = min(1.0, TO_THE_EDGE * float(np.min(-values[falling] / steps[falling], initial=np.inf)))
        weights, multipliers = np.split(values + length * steps, 2)
        points = []
        for i, one in enumerate(design.points):
            own = weights[labels == i]
            scale = one.weights.sum() / own.sum() if len(own) else 1.0
            points.append(replace(one, weights=own * scale))
        design = replace(design, points=tuple(points))
    return design


def _second_derivatives(at: Slopes, criterion: Criterion) -> Array:
    """Of ``-log det M`` or ``tr(L M^-1)`` by the weights of all records (n, n)."""
    points, root = at.design.points, inverse_root(at.information)
    centred = [at.centred(i, one.records, at.factor) for i, one in enumerate(points)]
    by_root = np.concatenate([at.centred(i, one.records, root) for i, one in enumerate(points)])
    count, a = by_root.shape[:2]
    hessian: Array = np.ones((count * a, count * a))
    for one in (np.concatenate(centred), by_root):
        flat = one.reshape(count * a, one.shape[-1])
        hessian *= flat @ flat.T
    hessian = hessian.reshape(count, a, count, a).sum(axis=(1, 3))
    hessian *= 1.0 if criterion.predictions is None else 2.0
    first = 0
    for point, own in zip(points, centred, strict=True):  # moving the centre costs information
        root = np.linalg.cholesky(point.normal()[:a, :a])
        moved = np.linalg.solve(root, np.swapaxes(point.records[:, :, :a], -1, -2) @ own)
        flat = moved.reshape(len(own), a * own.shape[-1])
        hessian[first : first + len(own), first : first + len(own)] += 2.0 * flat @ flat.T
        first += len(own)
    return hessian


@dataclass(frozen=True, eq=False)
class PoseDomain:
    """All poses at a point that its robot can take with the ball at the gauges' zero."""

    belief: RobotBelief
    zero: GaugeZero

    def records(self, targets: ReachableTargets) -> Array:
        """Whitened records (n, 3, 3 + p)."""
        jacobian, by_joints = position_derivatives(self.belief, targets)
        return whitened(jacobian, self.belief.noise.record_weights(by_joints))

    def climbed(
        self, at: Slopes, point: int, targets: ReachableTargets, random: np.random.Generator
    ) -> ReachableTargets:
        """The most sensitive of some poses, turned at random to where they are more so."""
        values = at.sensitivities(point, self.records(targets))
        best = rows_apart(targets.poses.rotations, np.argsort(-values), CLIMBING, CLIMBING_APART)
        present, values = targets[best], values[best]
        for angle in CLIMBS:
            turns = rotations.from_vector(random.uniform(-angle, angle, (len(present), 3)))
            turned, rows = self._possible(turns @ present.poses.rotations)
            found = at.sensitivities(point, self.records(turned))
            better = found > values[rows]
            joints = present.joints.copy()
            joints[rows[better]] = turned.joints[better]
            poses = present.poses.with_rows(rows[better], turned.poses[better])
            present = ReachableTargets(poses, joints)
            values[rows[better]] = found[better]
        return present

    def _possible(self, orientations: Array) -> tuple[ReachableTargets, NDArray[np.intp]]:
        poses = PoseBatch.at(self.zero.reference, orientations)
        found = reachable_targets(self.belief, poses, self._mode)
        matches = (orientations[:, None] == found.poses.rotations[None]).all(axis=(-2, -1))
        return found, np.argmax(matches, axis=0)

    @cached_property
    def _mode(self) -> Array:
        return self.zero.mode(self.belief)


def best_design(
    start: Design, domains: Sequence[PoseDomain], criterion: Criterion, gap: float
) -> tuple[Design, float]:
    """The best design over all poses of the points, and its certificate.

    Poses all over each domain are looked at, new ones in each round; the most sensitive are climbed and
    come in, until the certificate holds for the climbed ones too.
    """
    random = np.random.default_rng(0)
    known: list[list[ReachableTargets]] = [[] for _ in domains]
    design, found, certificate = start, start, 0.0
    for number in range(MOST_ROUNDS):
        nearness = max(gap, 0.2 * (1.0 - certificate))
        design = best_weights(design, criterion, 0.3 * nearness)
        points = tuple(one.supported(0.1 * nearness) for one in design.points)
        design = replace(design, points=points)
        at = Slopes.at(design, criterion)
        for point, domain in enumerate(domains):
            spread = possible_targets(domain.belief, domain.zero, SPREAD, number)
            seen = ReachableTargets.joined([*known[point], spread])
            known[point] = [domain.climbed(at, point, seen, random)]
        more = [domain.records(some) for domain, [some] in zip(domains, known, strict=True)]
        if (reached := at.certificate(more)) > certificate:
            found, certificate = design, reached
        if certificate >= 1.0 - gap:
            break
        best = [np.argsort(-at.sensitivities(i, records))[:ADDED] for i, records in enumerate(more)]
        added = zip(design.points, more, best, strict=True)
        design = replace(design, points=tuple(one.with_records(some[rows]) for one, some, rows in added))
    return found, certificate


def design_of(belief: RobotBelief, found: Identification) -> tuple[Design, list[PoseDomain]]:
    """The records of an identification as a design, each point's first one fixed, and the domains."""
    problem, domains, points = found.problem, [], []
    for point in np.unique(problem.labels[:, 0]).tolist():
        rows = np.flatnonzero(problem.labels[:, 0] == point)
        domain = PoseDomain(belief, gauge_zero_at(belief, found, int(point)))
        records = domain.records(ReachableTargets(found.poses[rows], problem.joints[rows]))
        domains.append(domain)
        points.append(PointDesign(records[:1], records[1:], np.ones(len(records) - 1)))
    return Design(tuple(points), problem.prior.precision), domains


def possible_targets(belief: RobotBelief, zero: GaugeZero, count: int, seed: int) -> ReachableTargets:
    """The poses, of ``count`` (a power of two) all over tilt and turn, that the estimated robot can take.

    The ball is where the gauges were zeroed, and the robot on the assembly mode that it had there.
    """
    heading, tilted, turned = qmc.Sobol(3, seed=seed).random(count).T
    limits, zeros = belief.limits, np.zeros(count)
    angle, heading = limits.tilt * np.sqrt(tilted), 2.0 * np.pi * heading
    directions = np.stack([np.cos(heading), np.sin(heading), zeros], axis=-1)
    turn = limits.turn * (2.0 * turned - 1.0)
    tilts = rotations.from_vector(angle[:, None] * directions)
    turns = rotations.from_vector(np.stack([zeros, zeros, turn], axis=-1))
    poses = PoseBatch.at(zero.reference, limits.orientations(tilts @ turns))
    return reachable_targets(belief, poses, zero.mode(belief))
