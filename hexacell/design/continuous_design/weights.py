"""The best weights of given records: Newton's method inside the simplices of the points.

Minimized is ``f = -log det M`` or ``f = tr(L M^-1)``, which are convex in the weights w, under w >= 0 and
a given sum at each point. The derivative by a weight is minus the record's sensitivity. With the whitened
centred rows ``X_i = R_i (J_i - Z K)``, ``C = M^-1 = H H^T``, and G of :mod:`.optimality`, the second
derivative by the weights of records i and l is

    k sum of (X_i G)(X_l G)^T * (X_i H)(X_l H)^T, element by element,     k = 1 for D, 2 for I,

and where both are at one point, with ``A = sum w Z^T V^-1 Z`` there, ``2 tr(U_i^T A^-1 U_l)`` besides, with
``U_i = Z^T R_i^T X_i G``: moving the centre costs information.

The primal-dual interior-point method (Boyd and Vandenberghe, Convex Optimization, 2004, 11.7) takes some
twenty steps, however many records compete. Each ends with the certificate on these records.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.design.continuous_design.certificate import Linearization
from hexacell.design.continuous_design.measure import DesignMeasure
from hexacell.design.continuous_design.optimality import Optimality
from hexacell.kinematics.rotations import Array

MOST_STEPS = 40
CENTRING = 0.15
"""The product of a weight and its multiplier is brought to this share of its mean at each step."""

TO_THE_EDGE = 0.9
"""Of the way to the first weight or multiplier that would be zero."""


def best_weights(design: DesignMeasure, optimality: Optimality, gap: float) -> DesignMeasure:
    """The design with the best weights on its own records, up to a gap of the certificate on these.

    All weights must be above zero.
    """
    multipliers: Array | None = None
    for _ in range(MOST_STEPS):
        at = Linearization.at(design, optimality)
        found = [at.sensitivities(point, one.records) for point, one in enumerate(design.points)]
        if at.least_efficiency([float(one.max(initial=0.0)) for one in found]) >= 1.0 - gap:
            break
        weights = np.concatenate([one.weights for one in design.points])
        if multipliers is None:
            multipliers = np.full(len(weights), at.total) / weights / len(weights)
        step = _Step.of(design, at, np.concatenate(found), weights, multipliers, optimality)
        weights, multipliers = step.taken(weights, multipliers)
        design = _with_weights(design, weights)
    return design


def _with_weights(design: DesignMeasure, weights: Array) -> DesignMeasure:
    """The same with other weights, each point's brought to its sum to the last digit."""
    counts = np.cumsum([len(one.weights) for one in design.points])[:-1]
    points = []
    for one, some in zip(design.points, np.split(weights, counts), strict=True):
        points.append(replace(one, weights=some * one.share / some.sum() if len(some) else some))
    return replace(design, points=tuple(points))


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """Of the weights (n,) and of the multipliers of their bounds (n,)."""

    weights: Array
    multipliers: Array

    @classmethod
    def of(
        cls,
        design: DesignMeasure,
        at: Linearization,
        sensitivities: Array,
        weights: Array,
        multipliers: Array,
        optimality: Optimality,
    ) -> _Step:
        target = CENTRING * float(weights @ multipliers) / len(weights)
        hessian = _second_derivatives(design, at, optimality)
        hessian[np.diag_indices(len(weights))] += multipliers / weights
        labels = np.repeat(np.arange(len(design.points)), [len(one.weights) for one in design.points])
        sums = (labels[:, None] == np.unique(labels)).astype(float)
        solved = np.linalg.solve(hessian, np.column_stack([sensitivities + target / weights, sums]))
        common = np.linalg.solve(sums.T @ solved[:, 1:], sums.T @ solved[:, 0])
        step = solved[:, 0] - solved[:, 1:] @ common
        return cls(step, target / weights - multipliers - multipliers / weights * step)

    def taken(self, weights: Array, multipliers: Array) -> tuple[Array, Array]:
        """Weights and multipliers after as much of the step as leaves all of them above zero."""
        both, steps = (
            np.concatenate([weights, multipliers]),
            np.concatenate([self.weights, self.multipliers]),
        )
        falling = steps < 0.0
        length = min(1.0, TO_THE_EDGE * float(np.min(-both[falling] / steps[falling], initial=np.inf)))
        return weights + length * self.weights, multipliers + length * self.multipliers


def _second_derivatives(design: DesignMeasure, at: Linearization, optimality: Optimality) -> Array:
    root = np.linalg.inv(np.linalg.cholesky(at.information)).T
    by_factor, by_root, parts = [], [], []
    for one, centre in zip(design.points, at.centres, strict=True):
        centred, c = one.records.centred(centre, at.factor), one.fixed.constants
        by_factor.append(centred)
        by_root.append(one.records.centred(centre, root))
        moved = np.swapaxes(one.records.rows[:, :, :c], -1, -2) @ centred
        normal = (one.fixed.normal() + one.records.normal(one.weights))[:c, :c]
        whitened = np.linalg.solve(np.linalg.cholesky(normal), moved)
        parts.append(whitened.reshape(len(whitened), np.prod(whitened.shape[1:], dtype=int)))
    products = _gram(np.concatenate(by_factor)) * _gram(np.concatenate(by_root))
    coordinates = by_root[0].shape[1]
    count = len(products) // coordinates
    blocks = products.reshape(count, coordinates, count, coordinates).sum(axis=(1, 3))
    hessian: Array = optimality.curvature * blocks
    first = 0
    for part in parts:
        rows = slice(first, first + len(part))
        hessian[rows, rows] += 2.0 * part @ part.T
        first += len(part)
    return hessian


def _gram(centred: Array) -> Array:
    flat = centred.reshape(-1, centred.shape[-1])
    gram: Array = flat @ flat.T
    return gram
