"""What the records of one run alone say of the free parameters, linearized at a geometry near the truth.

The stations' unknowns are eliminated. Beside the p free parameters, the state x has the k causes of those
systematic errors that are the same in all runs of a machine, in standard deviations: nothing tells them
from an unusual geometry in one run, and they cancel in the difference of two. With whitened rows H and
residuals r, predicted less measured, at the state x0, the cost of x is ``|r + H (x - x0)|^2``. All that
later computations need of it are ``H^T H`` and ``H^T (H x0 - r)``, which are added over runs (information
filter; Anderson and Moore, Optimal Filtering, 1979, section 6.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.problem.prior import SystematicModel, no_systematic_errors
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.linear_model import systematic_errors
from hexacell.identification.solver.measurement_model import NuisanceElimination, Prediction, predict
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import position_sensitivity


@dataclass(frozen=True, slots=True, eq=False)
class RunEvidence:
    """The evidence of one run on a state (s,): the free parameters, then the shared causes.

    Attributes:
        information: (s, s).
        weighted: (s,) information times the state that fits the run best.
    """

    information: Array
    weighted: Array

    def gradient(self, state: Array) -> Array:
        """(s,) of the log-likelihood at a state (s,)."""
        return self.weighted - self.information @ state

    def __add__(self, other: RunEvidence) -> RunEvidence:
        """Both together."""
        return RunEvidence(self.information + other.information, self.weighted + other.weighted)

    def in_terms_of(self, matrix: Array) -> RunEvidence:
        """The same evidence on numbers (u,) from which the state is made by a ``matrix`` (s, u)."""
        return RunEvidence(matrix.T @ self.information @ matrix, matrix.T @ self.weighted)


@dataclass(frozen=True, slots=True, eq=False)
class WhitenedRecords:
    """The records of one run, linearized at a geometry, with independent errors of unit variance.

    Attributes:
        state: (s,) where they are linearized: free parameters, and no causes.
        rows: (r, s) derivatives of the residuals.
        residuals: (r,) predicted less measured, there.
    """

    state: Array
    rows: Array
    residuals: Array

    @property
    def evidence(self) -> RunEvidence:
        """What they say of the state."""
        return RunEvidence(self.rows.T @ self.rows, self.rows.T @ (self.rows @ self.state - self.residuals))


def whiten_records(
    problem: Problem,
    free: Array,
    *,
    of_this_run: SystematicModel = no_systematic_errors,
    expansion: Array | None = None,
) -> WhitenedRecords:
    """The records of a problem that have a pose under the geometry of ``free`` parameters (p,), mm.

    Args:
        problem: its systematic errors are those that all runs of the machine share.
        free: where to linearize, near the truth.
        of_this_run: systematic errors that are others in each run.
        expansion: (n, P), by how much the parameters of the machine differ at each record from those that
            are sought, as by the temperature of the legs.
    """
    solved = problem.solve_poses(free)
    kept = problem.subset(solved.found)
    prediction = predict(kept, free, solved.poses[np.flatnonzero(solved.found)])
    residuals = prediction.residuals
    if expansion is not None:
        residuals = residuals + _moved_by(kept, prediction, expansion[solved.found])
    shared = systematic_errors(kept, prediction)
    own = systematic_errors(replace(kept, systematic=of_this_run), prediction)
    weights = np.linalg.inv(np.linalg.inv(prediction.weights) + shared.own + own.own)
    jacobian = np.concatenate([prediction.jacobian, shared.common, own.common], axis=-1)
    system = NuisanceElimination(kept, weights).system(residuals, jacobian)
    rows, causes = np.split(system.rows, [len(free) + shared.common.shape[-1]], axis=1)
    whitened = _whitened(causes, np.column_stack([rows, system.values]))
    state = np.concatenate([free, np.zeros(shared.common.shape[-1])])
    return WhitenedRecords(state, whitened[:, :-1], whitened[:, -1])


def _moved_by(problem: Problem, prediction: Prediction, expansion: Array) -> Array:
    """How far (n, 3), mm, the ball is moved by changes (n, P) of the parameters."""
    geometry = problem.geometry(prediction.free)
    at = problem.mechanism, geometry, prediction.poses, problem.joints
    moved: Array = np.einsum("nip,np->ni", position_sensitivity(*at)[0], expansion)
    return moved


def _whitened(causes: Array, values: Array) -> Array:
    """Values (r, m) for which causes (r, k) of unit variance count as noise."""
    if not causes.shape[1]:
        return values
    factor = np.linalg.cholesky(np.eye(len(causes)) + causes @ causes.T)
    from scipy.linalg import solve_triangular  # noqa: PLC0415 - a tenth of a second

    whitened: Array = solve_triangular(factor, values, lower=True)
    return whitened
