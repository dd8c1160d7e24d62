"""The best design measures beside those known in closed form, another solver, and every other design.

Polynomial regression on [-1, 1]: the D-optimal design has equal weights at the ends and at the extremes
of a Legendre polynomial (Guest 1958, Hoel 1958); the I-optimal one of a parabola has 1/4, 1/2, 1/4 at
-1, 0 and 1.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import Bounds, LinearConstraint, minimize

from hexacell.design.continuous_design.certificate import Linearization
from hexacell.design.continuous_design.measure import (
    DesignMeasure,
    PointMeasure,
    PossibleRecords,
)
from hexacell.design.continuous_design.optimality import DOptimality, IOptimality
from hexacell.design.continuous_design.solver import best_measure

GRID = np.unique(np.concatenate([np.linspace(-1.0, 1.0, 201), [-np.sqrt(0.2), np.sqrt(0.2)]]))
GAP = 1e-4


def polynomial(degree: int, constants: int) -> PossibleRecords:
    return PossibleRecords(
        np.stack([GRID**power for power in range(degree + 1)], axis=-1)[:, None], constants
    )


def evenly(records: PossibleRecords, share: float = 1.0) -> PointMeasure:
    """On every tenth record."""
    some = records[::10]
    return PointMeasure(records[:0], some, np.full(len(some), share / len(some)))


def masses(design: DesignMeasure) -> dict[float, float]:
    """The weight around each place that has some; neighbours on the grid are one place."""
    [point] = design.points
    found: dict[float, float] = {}
    for place, weight in zip(point.records.rows[:, 0, 1], point.weights, strict=True):
        near = next((one for one in found if abs(one - place) < 0.03), float(place))
        found[near] = found.get(near, 0.0) + float(weight)
    return {place: weight for place, weight in sorted(found.items()) if weight > 0.005}


EXTREMES = {2: [0.0], 3: [-np.sqrt(0.2), np.sqrt(0.2)], 4: [-np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7)]}


@pytest.mark.parametrize("degree", EXTREMES)
@pytest.mark.parametrize("constants", [0, 1], ids=["all parameters", "the constant eliminated"])
def test_d_optimal_designs_of_polynomials_are_the_known_ones(degree, constants):
    """With equal noise the constant may be eliminated: the determinant is divided by the records."""
    records = polynomial(degree, constants)
    free = degree + 1 - constants
    start = DesignMeasure((evenly(records),), np.zeros((free, free)))
    design, certificate = best_measure(start, [records], DOptimality(), GAP)
    assert certificate >= 1.0 - GAP
    found = masses(design)
    assert list(found) == pytest.approx([-1.0, *EXTREMES[degree], 1.0], abs=0.03)
    assert list(found.values()) == pytest.approx(np.full(degree + 1, 1.0 / (degree + 1)), abs=0.01)


def test_the_i_optimal_design_of_a_parabola_is_the_known_one():
    places, weights = np.polynomial.legendre.leggauss(5)
    average = np.sqrt(0.5 * weights)[:, None] * np.stack([places**power for power in range(3)], axis=-1)
    records = polynomial(2, 0)
    start = DesignMeasure((evenly(records),), np.zeros((3, 3)))
    design, certificate = best_measure(start, [records], IOptimality(average), GAP)
    assert certificate >= 1.0 - GAP
    found = masses(design)
    assert list(found) == pytest.approx([-1.0, 0.0, 1.0], abs=0.03)
    assert list(found.values()) == pytest.approx([0.25, 0.5, 0.25], abs=0.01)


def cases(seed: int) -> tuple[DesignMeasure, list[PossibleRecords], list[int]]:
    """Two points of records with unequal noise, three coordinates and four parameters."""
    random = np.random.default_rng(seed)
    jacobians = [random.standard_normal((12, 3, 4)) for _ in range(2)]
    factors = [np.eye(3) + 0.4 * random.standard_normal((12, 3, 3)) for _ in range(2)]
    possible = [
        PossibleRecords.of(jacobian, np.swapaxes(factor, -1, -2) @ factor)
        for jacobian, factor in zip(jacobians, factors, strict=True)
    ]
    counts = [3, 5]
    points = tuple(
        PointMeasure(records[:1], records, np.full(12, count / 12))
        for records, count in zip(possible, counts, strict=True)
    )
    return DesignMeasure(points, 0.1 * np.eye(4)), possible, counts


CRITERIA = pytest.mark.parametrize(
    "optimality", [DOptimality(), IOptimality(np.array([[1.0, 0.5, 0, 0], [0, 0, 1, -1]]))], ids=["D", "I"]
)


def information_of(point: PointMeasure) -> np.ndarray:
    """With the constants as further unknowns, of which the inverse is taken whole."""
    rows = np.concatenate([point.fixed.rows, point.records.rows])
    weights = np.concatenate([np.ones(len(point.fixed)), point.weights])
    normal = np.einsum("n,nai,naj->ij", weights, rows, rows)
    c = point.fixed.constants
    return np.linalg.inv(np.linalg.inv(normal + 1e-9 * np.eye(len(normal)))[c:, c:])


def test_information_is_that_with_the_constants_as_unknowns():
    start, _, _ = cases(3)
    total = start.prior + sum(information_of(point) for point in start.points)
    np.testing.assert_allclose(start.information()[0], total, rtol=1e-6)


def test_information_of_equal_weights_is_that_of_all_pairs():
    """Eq. 5-8 of Abtahi et al. 2010, each pair with 1/k of the weight."""
    jacobian = np.random.default_rng(4).standard_normal((6, 3, 4))
    records = PossibleRecords.of(jacobian, np.broadcast_to(np.eye(3), (6, 3, 3)))
    found = PointMeasure.of_campaign(records, 1).information()[0]
    pairs = [jacobian[first] - jacobian[second] for first in range(6) for second in range(first)]
    np.testing.assert_allclose(found, sum(pair.T @ pair for pair in pairs) / 6.0, rtol=1e-9)


@CRITERIA
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_no_campaign_is_better_than_the_certificate_says(optimality, seed):
    """Whole numbers of records, drawn at random, at any design: also at one that is far from the best."""
    start, possible, counts = cases(seed % 50)
    at = Linearization.at(start, optimality)
    largest = [float(at.sensitivities(point, records).max()) for point, records in enumerate(possible)]
    least = at.least_efficiency(largest)
    best, certificate = best_measure(start, possible, optimality, 1e-4)
    random = np.random.default_rng(seed)
    for _ in range(20):
        points = tuple(
            PointMeasure(records[:1], records[random.integers(0, 12, count)], np.ones(count))
            for records, count in zip(possible, counts, strict=True)
        )
        other = DesignMeasure(points, start.prior).information()[0]
        assert optimality.efficiency(at.information, other) >= least - 1e-9
        assert optimality.efficiency(best.information()[0], other) >= certificate - 1e-9
    assert optimality.efficiency(at.information, best.information()[0]) >= least - 1e-9


def value(optimality, information: np.ndarray) -> float:
    if isinstance(optimality, DOptimality):
        return -float(np.linalg.slogdet(information)[1])
    return float(np.trace(optimality.predictions @ np.linalg.inv(information) @ optimality.predictions.T))


@CRITERIA
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_another_solver_finds_no_better_weights(optimality, seed):
    """Sequential quadratic programming, with derivatives by differences."""
    start, possible, counts = cases(seed)

    def with_weights(weights: np.ndarray) -> DesignMeasure:
        points = tuple(
            PointMeasure(records[:1], records, np.maximum(some, 0.0))
            for records, some in zip(possible, np.split(weights, 2), strict=True)
        )
        return DesignMeasure(points, start.prior)

    def objective(weights: np.ndarray) -> float:
        return value(optimality, with_weights(weights).information()[0])

    found = minimize(
        objective,
        np.repeat(np.array(counts) / 12.0, 12),
        method="SLSQP",
        bounds=Bounds(0.0, np.inf),
        constraints=[LinearConstraint(np.repeat(np.eye(2), 12, axis=1), counts, counts)],
        options={"maxiter": 500, "ftol": 1e-12},
    )
    design, certificate = best_measure(start, possible, optimality, GAP)
    assert certificate >= 1.0 - GAP
    ours = optimality.efficiency(design.information()[0], with_weights(found.x).information()[0])
    assert ours == pytest.approx(1.0, abs=2e-4)
