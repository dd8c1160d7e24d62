"""The least costs against dense generalized least squares with the full covariance of all records."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.linalg import block_diag, null_space
from scipy.stats import multivariate_normal

from hexacell.identification.diagnostics.model_tests import leave_one_point_out, prediction_test
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise, no_systematic_errors
from hexacell.identification.solver.linear_model import LinearCosts, systematic_errors
from hexacell.kinematics.rotations import skew
from hexacell.uncertainty.effect_kinds import ball_roundness, encoder_scales, stop_repeatability
from hexacell.uncertainty.effects import errors_by_effects

NOISE = Noise(0.01, 0.01, alignment=0.005, gauge_scale=1e-3)
EFFECTS = partial(errors_by_effects, (encoder_scales(30.0), stop_repeatability(8.0), ball_roundness(6.0)))


@pytest.fixture(scope="module")
def found(visit, make_problem):
    """An identification that takes no account of the effects that are stated beside the noise."""
    problem = make_problem(visit(seed=2).measured(0.012, 4), noise=NOISE)
    return identify(replace(problem, systematic=EFFECTS), find_outliers=False)


def covariance(found, rows):
    """Of the deviations of some records, with stations turned, gauges' scales and effects."""
    problem, errors = found.problem, systematic_errors(found.problem, found.prediction)
    own = block_diag(*(np.linalg.inv(found.prediction.weights[rows]) + errors.own[rows]))
    at_point = problem.labels[rows, 0][:, None] == np.unique(problem.labels[:, 0])
    turned = np.einsum("nij,nm->nijm", skew(problem.deviations[rows]), at_point)
    scaled = problem.deviations[rows][:, :, None] * np.eye(3)
    parts = (
        (NOISE.alignment, turned.reshape(len(own), -1)),
        (NOISE.gauge_scale, scaled.reshape(len(own), -1)),
        (1.0, errors.common[rows].reshape(len(own), -1)),
    )
    return own + sum(size**2 * columns @ columns.T for size, columns in parts)


def dense_cost(found, rows, precision):
    """The least ``e^T V^-1 e + (p - p0)^T L (p - p0)`` over parameters and zeros of the points."""
    problem = found.problem
    at_point = problem.labels[rows, 0][:, None] == np.unique(problem.labels[rows, 0])
    zeros = np.einsum("nm,ij->nimj", at_point, np.eye(3)).reshape(3 * rows.sum(), -1)
    jacobian = found.prediction.jacobian[rows].reshape(len(zeros), -1)
    whitening = np.linalg.inv(np.linalg.cholesky(covariance(found, rows)))
    values, vectors = np.linalg.eigh(precision)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    design = np.vstack(
        [whitening @ np.hstack([jacobian, zeros]), np.hstack([root, np.zeros((len(root), zeros.shape[1]))])]
    )
    residuals = whitening @ found.prediction.residuals[rows].ravel()
    both = np.concatenate([residuals, root @ (found.free - problem.prior.free)])
    best = np.linalg.lstsq(design, -both, rcond=None)[0]
    return np.sum((both + design @ best) ** 2)


def test_the_residuals_are_tested_under_the_full_covariance(found):
    tested = found.goodness
    every = np.ones(found.records, dtype=bool)
    dense = dense_cost(found, every, np.zeros_like(found.active_prior))
    assert not found.active_prior.any()
    assert tested.chi2 == pytest.approx(dense, rel=1e-6)
    assert tested.expected == pytest.approx(found.problem.coordinates - len(found.free))
    assert tested.chi2 < 0.8 * found.noise_test.chi2


def test_a_point_is_predicted_under_the_full_covariance(found):
    """What records share is known better after the others: their errors are not independent."""
    precision = found.problem.prior.precision
    rows = found.problem.labels[:, 0] == 3
    every = np.ones(found.records, dtype=bool)
    dense = dense_cost(found, every, precision) - dense_cost(found, ~rows, precision)
    tested = prediction_test(found, rows)
    assert tested.chi2 == pytest.approx(dense, rel=1e-5)
    assert tested.expected == 30
    assert leave_one_point_out(found)[2].test == tested


def test_evidence_is_the_density_of_all_that_the_points_zeros_leave(found):
    """Of records whose noise is larger by a factor, with and without causes that they share."""
    problem, scale, rows = found.problem, 1.7, np.ones(found.records, dtype=bool)
    shared = 0.03 * np.random.default_rng(3).standard_normal((found.records, 3, 4))
    common = systematic_errors(problem, found.prediction).common.reshape(3 * found.records, -1)
    jacobian = found.prediction.jacobian.reshape(len(common), -1)
    zeros = np.kron(problem.labels[:, :1] == np.unique(problem.labels[:, 0]), np.eye(3))
    contrasts = null_space(zeros.T).T
    noise = scale * (covariance(found, rows) - common @ common.T) + common @ common.T
    before = noise + jacobian @ problem.prior.covariance @ jacobian.T
    off = found.prediction.residuals.ravel() + jacobian @ (problem.prior.free - found.free)

    def density(causes):
        spread = before + causes.reshape(len(common), -1) @ causes.reshape(len(common), -1).T
        return multivariate_normal(cov=contrasts @ spread @ contrasts.T).logpdf(contrasts @ off)

    linear = LinearCosts.at(problem, found.prediction)
    gain = linear.with_causes(shared).log_evidence(rows, scale) - linear.log_evidence(rows, scale)
    assert gain == pytest.approx(density(shared) - density(np.zeros_like(shared)), rel=1e-5)


def test_without_systematic_errors_it_is_the_test_of_the_noise(found):
    problem = replace(found.problem, systematic=no_systematic_errors)
    alone = replace(found, problem=problem)
    linear = LinearCosts.at(problem, found.prediction).residual_test(found.active_prior)
    assert alone.goodness == alone.noise_test
    assert linear.chi2 == pytest.approx(alone.noise_test.chi2, rel=1e-6)
    assert linear.expected == pytest.approx(alone.noise_test.expected)
