"""The test of the residuals has the stated probability, and its sentence names the right noise."""

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.solver.chi_square import ChiSquareTest, ChiSquareVerdict
from hexacell.verdict.acceptance_gates import residual_sentence


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
