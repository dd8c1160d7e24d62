"""The covariance of an identification, against many repetitions of one measurement."""

import numpy as np
import pytest
from scipy.stats import chi2

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS


@pytest.fixture(scope="session")
def truth(hexaglide, paper):
    return hexaglide.convention.free_parameters(paper.actual)


def within(total, degrees, alarm=1e-4):
    """Whether a sum of squares of standard normal numbers is plausible on both sides."""
    low, high = chi2.interval(1.0 - alarm, degrees)
    return low < total < high


def test_the_scatter_of_repeated_estimates_agrees_with_every_sigma_and_all_together(repeated, truth):
    errors = np.array([found.free - truth for found in repeated])
    total = sum(
        e @ np.linalg.solve(one.free_covariance, e) for e, one in zip(errors, repeated, strict=True)
    )
    assert within(total, errors.size)
    told = np.sqrt(np.diag(repeated[0].free_covariance))
    low, high = np.sqrt(chi2.interval(1.0 - 1e-4, len(repeated)) / np.array(len(repeated)))
    ratio = np.sqrt(np.mean(errors**2, axis=0)) / told
    assert low < ratio.min()
    assert ratio.max() < high


def test_clean_records_are_never_left_out(repeated):
    assert [found.data_faults for found in repeated] == [()] * len(repeated)
    assert {found.records for found in repeated} == {55}
    assert all(found.termination.converged for found in repeated)
    assert {found.undetermined for found in repeated} == {()}


@pytest.mark.parametrize("factor", [0.2, 5.0])
def test_a_wrongly_stated_noise_fails_the_chi_square_test_and_rejects_no_record(
    noisy, make_problem, factor
):
    found = identify(make_problem(noisy, noise=Noise(0.01 * factor, 0.01 * factor)))
    assert found.data_faults == ()
    assert within(found.chi2 * factor**2, found.dof)
    assert not within(found.chi2, found.dof)


def test_the_full_covariance_follows_from_the_free_one(identified, hexaglide):
    convention = hexaglide.convention
    assert identified.covariance.shape == (42, 42)
    np.testing.assert_array_equal(identified.covariance, identified.covariance.T)
    assert np.linalg.eigvalsh(identified.free_covariance).min() > 0.0
    for row, name in enumerate(HEXAGLIDE_PARAMETERS.names):
        if name in convention.zero:
            assert not identified.covariance[row].any()
            assert identified.sigma[row] == 0.0
        else:
            assert identified.sigma[row] > 0.0
    same = [HEXAGLIDE_PARAMETERS.names.index(name) for name in ("B2z", "B3z", "B5z")]
    np.testing.assert_array_equal(identified.sigma[same], identified.sigma[same[0]])
    np.testing.assert_array_equal(identified.covariance[same[0]], identified.covariance[same[1]])


def test_pairs_are_those_of_repeated_measurements(repeated, hexaglide):
    """Against the correlation of 40 estimates, good to (1 - rho^2) / sqrt(40)."""
    names = hexaglide.convention.free_names
    seen = np.corrcoef(np.array([found.free for found in repeated]).T)
    pairs = repeated[0].strongly_correlated()
    assert pairs
    for pair in pairs:
        i, j = names.index(pair.first), names.index(pair.second)
        error = (1.0 - pair.correlation**2) / np.sqrt(len(repeated))
        assert seen[i, j] == pytest.approx(pair.correlation, abs=5.0 * error)


def test_all_pairs_beyond_the_limit_are_named_the_strongest_first(identified):
    everything = identified.strongly_correlated(above=-1.0)
    strengths = [abs(pair.correlation) for pair in everything]
    assert len(everything) == 35 * 34 // 2
    assert strengths == sorted(strengths, reverse=True)
    assert identified.strongly_correlated(above=0.8) == tuple(
        pair for pair in everything if abs(pair.correlation) > 0.8
    )
    assert all(pair.first != pair.second for pair in everything)
