"""The paper's second solver, a cross-check that needs no derivatives (Abtahi et al. 2010, section 2)."""

from scipy.optimize import least_squares

from hexacell.errors import ConvergenceError
from hexacell.identification.problem.problem import Problem
from hexacell.kinematics.forward import ForwardResult
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.study.reference_solvers import error_vector


def least_squares_without_jacobian(problem: Problem) -> Geometry:
    """The paper's second solver (lsqnonlin): finite differences, a trust region, scipy's TRF.

    Raises:
        ConvergenceError: scipy reports no convergence, or the solution is on another assembly mode.
    """

    def reached(free: Array) -> ForwardResult:
        return problem.solve_poses(free)

    def error(free: Array) -> Array:
        return error_vector(problem, reached(free).poses.positions - problem.deviations)

    found = least_squares(
        error,
        problem.initial_parameters,
        method="trf",
        x_scale=1.0,
        ftol=1e-15,
        xtol=1e-15,
        gtol=1e-15,
        max_nfev=100,
    )
    if not found.success or not reached(found.x).found.all():
        raise ConvergenceError(f"the least-squares solver ended without a solution: {found.message}")
    return problem.geometry(found.x)
