"""Tests of residuals have the stated probability under the full covariance, and name the right noise."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.linalg import block_diag, null_space
from scipy.stats import multivariate_normal

from hexacell.identification.diagnostics.model_tests import leave_one_point_out, prediction_test
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise, no_systematic_errors
from hexacell.identification.solver.chi_square import ChiSquareTest, ChiSquareVerdict
from hexacell.identification.solver.linear_model import LinearCosts, systematic_errors
from hexacell.kinematics.rotations import skew
from hexacell.uncertainty.effect_kinds import ball_roundness, encoder_scales, stop_repeatability
from hexacell.uncertainty.effects import errors_by_effects
from hexacell.verdict.acceptance_gates import residual_sentence

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
    assert leave_one_point_out(found)[3] == tested


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


def test_probability_is_the_table_s():
    assert ChiSquareTest(18.307, 10.0).probability == pytest.approx(0.05, abs=1e-5)
    assert ChiSquareTest(124.342, 100.0).probability == pytest.approx(0.05, abs=1e-5)


def test_chi_square_is_the_identification_s_and_expects_its_degrees_of_freedom(identified):
    tested = identified.goodness
    assert tested.chi2 == pytest.approx(identified.chi2, rel=1e-9)
    assert tested.expected == pytest.approx(identified.dof, abs=1e-4)


@pytest.mark.slow
def test_probabilities_of_repeated_measurements_are_spread_evenly(repeated):
    """Kolmogorov's distance from the uniform distribution, at the level 0.001."""
    found = np.sort([one.goodness.probability for one in repeated])
    steps = np.arange(len(found) + 1) / len(found)
    distance = max(np.abs(found - steps[1:]).max(), np.abs(found - steps[:-1]).max())
    assert distance < 1.95 / np.sqrt(len(found))
    assert all(one.goodness.agreement is ChiSquareVerdict.AGREES for one in repeated)


def test_the_prior_reduces_the_degrees_of_freedom_of_parameters(visit, make_problem):
    """Against the trace of the dense matrix that takes the records to their residuals."""
    found = identify(make_problem(visit(points=2, orientations=9, degrees=3.0).measured(0.01)))
    assert found.undetermined
    model, held = found.prediction, found.active_prior
    n, p = found.records, len(found.free)
    at_point = found.problem.labels[:, :1] == np.unique(found.problem.labels[:, 0])
    zeros = np.einsum("nm,ij->nimj", at_point, np.eye(3)).reshape(3 * n, -1)
    design = np.concatenate([model.jacobian.reshape(3 * n, p), zeros], axis=1)
    root = np.linalg.cholesky(np.linalg.inv(model.weights))
    whitened = np.linalg.solve(root, design.reshape(n, 3, -1)).reshape(3 * n, -1)
    prior = np.zeros((design.shape[1],) * 2)
    prior[:p, :p] = held
    # Of records alone: the parameters' prior is no datum.
    information = whitened.T @ whitened
    expected = 3 * n - np.trace(np.linalg.solve(information + prior, information))
    assert found.goodness.expected == pytest.approx(expected, abs=1e-3)
    assert expected > found.dof + 3.0


@pytest.mark.parametrize(
    ("noise_mm", "agreement", "least", "most", "words"),
    [
        (0.03, ChiSquareVerdict.TOO_LARGE, 2.5, 3.5, "residuals are {:.1f} times the stated noise"),
        (0.003, ChiSquareVerdict.TOO_SMALL, 0.2, 0.4, "are only {:.2f} times the stated noise"),
    ],
)
def test_another_noise_than_stated_is_reported_with_its_factor(
    visit, make_problem, noise_mm, agreement, least, most, words
):
    tested = identify(make_problem(visit(seed=2).measured(noise_mm, seed=5))).goodness
    assert tested.agreement is agreement
    assert least < tested.ratio < most
    assert words.format(tested.ratio) in residual_sentence(tested)


def test_a_percent_too_much_noise_is_no_disagreement_and_no_spare_records_prove_nothing() -> None:
    tested = ChiSquareTest(chi2=1.02e6, expected=1e6)
    assert tested.probability < 1e-20
    assert tested.agreement is ChiSquareVerdict.AGREES
    tested = ChiSquareTest(chi2=0.0, expected=1e-9)
    assert tested.agreement is ChiSquareVerdict.NOT_EVALUATED
    assert "prove nothing" in residual_sentence(tested)
