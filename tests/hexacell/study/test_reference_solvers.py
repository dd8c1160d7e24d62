"""The paper's method, eq. 5 to 13: all pairs, ordinary least squares."""

import numpy as np
import pytest

from hexacell.errors import ConvergenceError
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver import fit as levenberg_marquardt
from hexacell.identification.solver.fit import FINE
from hexacell.identification.solver.measurement_model import predict
from hexacell.study import reference_solvers


@pytest.fixture(scope="module")
def problem(noisy, make_problem):
    return make_problem(noisy)


def test_the_pairwise_minimum_is_the_unweighted_centred_one(noisy, make_problem, problem):
    """With no noise on the encoders all weights are equal, and centring is subtracting the mean."""
    unweighted = make_problem(noisy, noise=Noise(encoder=0.0, gauge_mm=0.01))
    parameters = len(problem.prior.covariance)
    start = predict(unweighted, unweighted.prior.free, unweighted.start)
    centred = levenberg_marquardt.solve(unweighted, np.zeros((parameters, parameters)), start, FINE)
    assert centred.termination.converged
    pairwise = problem.mechanism.convention.free_parameters(reference_solvers.gauss_newton(problem))
    np.testing.assert_allclose(centred.free, pairwise, rtol=0, atol=1e-6)


def test_gauss_newton_reports_that_it_left_the_assembly_mode(visit, make_problem):
    """From errors of millimetres it may step over a singularity; the paper asks for a good start."""
    with pytest.raises(ConvergenceError, match="assembly mode"):
        reference_solvers.gauss_newton(make_problem(visit(seed=0).measured()))


def test_gauss_newton_reports_that_it_did_not_converge(problem):
    with pytest.raises(ConvergenceError, match="in 2 steps"):
        reference_solvers.gauss_newton(problem, steps=2)
