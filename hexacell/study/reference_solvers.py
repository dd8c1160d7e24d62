"""The paper's own solver, kept as a cross-check (Abtahi et al. 2010, section 2).

It minimises the plain sum of squares of all pairwise differences, eq. 5-8:
``E = (P_r - d_r) - (P_n - d_n)`` for every two records r, n of a point. No weights, no prior.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import ConvergenceError
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array


def pairs(problem: Problem) -> NDArray[np.intp]:
    """Rows (r, n) of every two records of one point (pairs, 2), r < n."""
    spans = zip(problem.first_rows, np.append(problem.first_rows[1:], problem.records), strict=True)
    found = [pair for first, end in spans for pair in itertools.combinations(range(first, end), 2)]
    return np.array(found, dtype=np.intp).reshape(-1, 2)


def error_vector(problem: Problem, residuals: Array) -> Array:
    """E of eq. 6-8 (3 m k (k-1) / 2,), mm, of residuals P - d (n, 3)."""
    rows = pairs(problem)
    return (residuals[rows[:, 0]] - residuals[rows[:, 1]]).ravel()


def gauss_newton(problem: Problem, *, steps: int = 30, tolerance_mm: float = 1e-9) -> Geometry:
    """Eq. 13: ``d <- d - (A^T A)^-1 A^T E``, from where the problem starts.

    Raises:
        ConvergenceError: it left the assembly mode or did not settle; the paper's method needs a
            good initial estimate.
    """
    problem = problem.subset(problem.has_start_pose)
    free, poses = problem.initial_parameters, problem.start
    rows = pairs(problem)
    for _ in range(steps):
        prediction = measurement_model.predict(problem, free, poses)
        error = error_vector(problem, prediction.residuals)
        jacobian = prediction.jacobian[rows[:, 0]] - prediction.jacobian[rows[:, 1]]
        step: Array = -np.linalg.lstsq(jacobian.reshape(len(error), -1), error)[0]
        free = free + step
        geometry = problem.geometry(free)
        reached = forward_kinematics(problem.mechanism, geometry, problem.joints, poses)
        if not reached.found.all():
            raise ConvergenceError("Gauss-Newton left the assembly mode of a record")
        poses = reached.poses
        if np.abs(step).max() < tolerance_mm:
            return geometry
    raise ConvergenceError(f"Gauss-Newton did not converge in {steps} steps")
