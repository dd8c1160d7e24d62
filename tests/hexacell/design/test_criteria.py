"""What a record is worth: by the covariance before and after it."""

import numpy as np
import pytest

from hexacell.design.criteria import D_OPTIMAL, Criterion, covariance_update


def records(seed: int, count: int = 5, parameters: int = 7):
    """A covariance, a weight, and Jacobians and covariances of some records."""
    random = np.random.default_rng(seed)
    roots = random.normal(size=(2, parameters, parameters))
    noise_roots = random.normal(size=(count, 3, 3))
    noise = noise_roots @ np.swapaxes(noise_roots, -1, -2) + 0.1 * np.eye(3)
    return *(root @ root.T for root in roots), random.normal(size=(count, 3, parameters)), noise


@pytest.mark.parametrize("seed", range(3))
def test_a_weighted_gain_is_what_the_record_takes_off_the_weighted_variance(seed):
    covariance, weight, jacobian, noise = records(seed)
    gains = Criterion(weight).gain(covariance, jacobian, noise)
    for gain, one, own in zip(gains, jacobian, noise, strict=True):
        after = covariance_update(covariance, one, own)
        assert gain == pytest.approx(np.trace(weight @ covariance) - np.trace(weight @ after), rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_gain_of_information_is_what_the_record_takes_off_the_volume(seed):
    covariance, _, jacobian, noise = records(seed)
    gains = D_OPTIMAL.gain(covariance, jacobian, noise)
    for gain, one, own in zip(gains, jacobian, noise, strict=True):
        after = covariance_update(covariance, one, own)
        ratio = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(after)[1]
        assert gain == pytest.approx(0.5 * ratio, rel=1e-9)
