"""Noise levels by the residuals, against known ones and against the likelihood itself."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.result import Identification
from hexacell.noise.record_noise import NoiseLevels, noise_levels
from tests.hexacell.altered_records import altered

REPETITIONS = 30


def levels_in(found: Identification) -> NoiseLevels:
    levels = noise_levels(found)
    assert levels is not None
    return levels


def with_noise(exact, encoder, gauge_mm, seed):
    random = np.random.default_rng(seed)

    def noisy(record):
        joints = record.joints + encoder * random.standard_normal(6)
        return {"joints": joints, "deviation": record.deviation + gauge_mm * random.standard_normal(3)}

    return altered(exact.measured(), noisy)


@pytest.mark.sample("0.005-0.02")
@pytest.mark.parametrize(("encoder", "gauge_mm"), [(0.02, 0.01), (0.005, 0.02), (0.01, 0.01)])
def test_levels_are_found_without_bias_and_with_their_standard_errors(
    visit, make_problem, encoder, gauge_mm
):
    exact = visit(seed=2)
    measured = [with_noise(exact, encoder, gauge_mm, seed) for seed in range(REPETITIONS)]
    found = [levels_in(identify(make_problem(each), find_outliers=False)) for each in measured]
    for true, levels in (
        (encoder, [one.encoder for one in found]),
        (gauge_mm, [one.gauge for one in found]),
    ):
        variances = np.array([one.estimated for one in levels]) ** 2
        scatter = variances.std(ddof=1)
        assert abs(variances.mean() - true**2) < 4.0 * scatter / np.sqrt(REPETITIONS)
        told = np.mean([2.0 * one.estimated * one.standard_error for one in levels])
        # A standard deviation of 30 numbers is good to 13 %.
        assert told == pytest.approx(scatter, rel=0.5)


def test_levels_do_not_depend_on_what_was_stated(visit, make_problem):
    measured = with_noise(visit(seed=2), 0.02, 0.01, 3)
    first, second = (
        levels_in(identify(make_problem(measured, noise=stated), find_outliers=False))
        for stated in (Noise(0.01, 0.01), Noise(0.03, 0.004))
    )
    assert second.encoder.estimated == pytest.approx(first.encoder.estimated, rel=1e-2)
    assert second.gauge.estimated == pytest.approx(first.gauge.estimated, rel=1e-2)


class Dense:
    """The linear model of the records with all its matrices written out."""

    def __init__(self, found: Identification) -> None:
        problem, model = found.problem, found.prediction
        n, p = problem.records, model.jacobian.shape[-1]
        place = np.searchsorted(problem.first_rows, np.arange(n), side="right") - 1
        constants = (np.eye(3)[None, :, None, :] * np.eye(problem.points)[place][:, None, :, None]).reshape(
            3 * n, -1
        )
        self.design = np.concatenate([model.jacobian.reshape(3 * n, p), constants], axis=1)
        # Metres of unknown constants would cost the likelihood half its digits.
        residuals = model.residuals.reshape(-1)
        self.residuals = residuals - self.design @ np.linalg.lstsq(self.design, residuals)[0]
        through_machine = np.zeros((3 * n, 3 * n))
        for row, by_joints in enumerate(model.by_joints):
            block = slice(3 * row, 3 * row + 3)
            through_machine[block, block] = by_joints @ by_joints.T
        self.shapes = (through_machine, np.eye(3 * n))

    def projection(self, variances):
        weights = np.linalg.inv(sum(v * shape for v, shape in zip(variances, self.shapes, strict=True)))
        normal = self.design.T @ weights @ self.design
        return weights - weights @ self.design @ np.linalg.solve(normal, self.design.T @ weights), normal

    def minus_twice_log_likelihood(self, variances) -> float:
        projection, normal = self.projection(variances)
        covariance = sum(v * shape for v, shape in zip(variances, self.shapes, strict=True))
        determinants = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(normal)[1]
        return float(determinants + self.residuals @ projection @ self.residuals)

    def information(self, variances):
        products = [self.projection(variances)[0] @ shape for shape in self.shapes]
        return 0.5 * np.array([[np.sum(a * b.T) for b in products] for a in products])


@pytest.fixture(scope="module")
def modelled(visit, make_problem):
    """Every parameter determined, so that no prior takes part."""
    measured = with_noise(visit(seed=2), 0.02, 0.01, 4)
    return identify(make_problem(measured), find_outliers=False)


def test_the_estimate_is_the_maximum_of_the_restricted_likelihood(modelled):
    dense, found = Dense(modelled), levels_in(modelled)

    def cost(logarithms: NDArray[np.float64]) -> float:
        return dense.minus_twice_log_likelihood(np.exp(logarithms))

    best = minimize(
        cost, np.log([1e-4, 1e-4]), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-9}
    )
    encoder, gauge = np.exp(0.5 * best.x)
    assert found.encoder.estimated == pytest.approx(encoder, rel=1e-4)
    assert found.gauge.estimated == pytest.approx(gauge, rel=1e-4)


def test_standard_errors_are_nearly_those_of_the_exact_information(modelled):
    found = levels_in(modelled)
    sigma = np.array([found.encoder.estimated, found.gauge.estimated])
    covariance = np.linalg.inv(Dense(modelled).information(sigma**2))
    exact = np.sqrt(np.diag(covariance)) / (2.0 * sigma)
    assert found.encoder.standard_error == pytest.approx(exact[0], rel=0.1)
    assert found.gauge.standard_error == pytest.approx(exact[1], rel=0.1)
    told = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found.correlation == pytest.approx(told, abs=0.1)


def test_few_records_do_not_separate_the_two(visit, make_problem):
    """14 records at 2 points: one equation more than parameters."""
    measured = with_noise(visit(seed=2, points=2, orientations=7), 0.01, 0.01, 0)
    found = identify(make_problem(measured), find_outliers=False)
    levels = noise_levels(found)
    assert levels is None or not (levels.encoder.is_resolved and levels.gauge.is_resolved)
