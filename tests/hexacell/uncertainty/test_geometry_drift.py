"""The prior of a drifted geometry has the covariance of drawn machines; its likelihood is exact."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from hexacell.design.candidates import ReachableTargets
from hexacell.design.predicted_records import position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import IdentifiedBefore, Noise, Prior, drift_covariance
from hexacell.identification.problem.problem import Assumptions
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.limits.limits import Limits


@pytest.fixture(scope="module")
def geometry(paper: Any, hexaglide: Hexaglide) -> Geometry:
    return hexaglide.normalize_frames(paper.actual)[0]


def test_drift_of_all_parameters_has_the_covariance_of_drawn_machines(hexaglide, geometry) -> None:
    random = np.random.default_rng(0)
    drawn = geometry.vector + 0.02 * random.standard_normal((1500, len(geometry.vector)))
    normal = (hexaglide.normalize_frames(Geometry(geometry.parameters, one))[0] for one in drawn)
    free = np.array([hexaglide.convention.free_parameters(one) for one in normal])
    expected = drift_covariance(hexaglide, geometry, np.full(len(geometry.vector), 0.02))
    sigma = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        np.cov(free.T) / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=0.15
    )


def test_drifts_of_any_scale_are_added_to_what_was_left_unknown(hexaglide, geometry) -> None:
    before = IdentifiedBefore(hexaglide, geometry, 4.0 * np.eye(35), np.eye(35))
    prior = before.prior(3.0)
    np.testing.assert_array_equal(prior.covariance, 13.0 * np.eye(35))
    assert prior.centre is geometry
    np.testing.assert_array_equal(prior.free, hexaglide.convention.free_parameters(geometry))


def test_the_marginal_likelihood_is_that_of_a_normal_distribution(
    hexaglide, geometry, paper, visit, make_problem
) -> None:
    """Of the records less their point's first one; but for a constant, which two priors share."""
    records = visit(paper.actual, paper.actual, points=3, orientations=4, seed=4).measured(0.01, seed=2)
    covariance = drift_covariance(hexaglide, geometry, np.full(42, 0.02))
    noise = Noise(0.01, 0.01)
    free = hexaglide.convention.free_parameters(geometry)

    def by_integral(scale: float) -> float:
        prior = Prior(geometry, free, scale**2 * covariance)
        controller = CommandingGeometry.of(hexaglide, paper.actual)
        arguments = {"controller": controller, "branch": paper.branch, "noise": noise}
        problem = Assumptions(hexaglide, prior=prior, **arguments).problem(records)
        return estimate_online(problem).log_marginal_likelihood

    def directly(scale: float) -> float:
        belief = RobotBelief(hexaglide, geometry, paper.branch, free, covariance, noise, LIMITS)
        frames = hexaglide.normalize_frames(paper.actual)[1]
        poses = forward_kinematics(hexaglide, geometry, records.joints, frames.poses(records.poses)).poses
        jacobian, by_joints = position_derivatives(belief, ReachableTargets(poses, records.joints))
        errors = poses.positions - frames.deviations(records.deviations)
        own = np.zeros((12, 3, 12, 3))
        for row, value in enumerate(noise.record_covariance(by_joints)):
            own[row, :, row] = value
        flat = jacobian.reshape(36, -1)
        total = own.reshape(36, 36) + scale**2 * flat @ covariance @ flat.T
        difference = np.kron(differences(3, 4), np.eye(3))
        return float(
            multivariate_normal.logpdf(
                difference @ errors.ravel(), cov=difference @ total @ difference.T, allow_singular=False
            )
        )

    for scale in (3.0, 10.0):
        assert by_integral(scale) - by_integral(1.0) == pytest.approx(
            directly(scale) - directly(1.0), abs=0.05
        )


LIMITS = Limits(5.0, 1.0, -1000.0, 1000.0, 0.03)


def differences(points: int, orientations: int) -> np.ndarray:
    """Each record less the first one of its point."""
    one = np.hstack([-np.ones((orientations - 1, 1)), np.eye(orientations - 1)])
    return np.kron(np.eye(points), one)
