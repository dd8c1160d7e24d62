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
from numpy.typing import NDArray

from hexacell.identification.problem.prior import SystematicModel, no_systematic_errors
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.linear_model import systematic_errors
from hexacell.identification.solver.measurement_model import NuisanceElimination, predict
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import position_sensitivity


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """Single causes of a change of a robot: its parameters, each taken alone.

    Attributes:
        by_state: (m, s) change of the state by one unit of each.
        legs: (m,) the leg of each, from 1.
        free: how many numbers of the state are free parameters; the others are shared causes.
    """

    by_state: Array
    legs: NDArray[np.int_]
    free: int


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
        """Gradient (s,) of the log-likelihood at a state (s,)."""
        return self.weighted - self.information @ state

    def __add__(self, other: RunEvidence) -> RunEvidence:
        """The evidence of both together."""
        return RunEvidence(self.information + other.information, self.weighted + other.weighted)


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
        """The evidence of the records on the state."""
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
        at = problem.mechanism, problem.geometry(prediction.free), prediction.poses, kept.joints
        by_parameters, _ = position_sensitivity(*at)
        residuals = residuals + np.einsum("nip,np->ni", by_parameters, expansion[solved.found])
    shared = systematic_errors(kept, prediction)
    own = systematic_errors(replace(kept, systematic=of_this_run), prediction)
    weights = np.linalg.inv(np.linalg.inv(prediction.weights) + shared.own + own.own)
    jacobian = np.concatenate([prediction.jacobian, shared.common, own.common], axis=-1)
    system = NuisanceElimination(kept, weights).system(residuals, jacobian)
    rows, causes = np.split(system.rows, [len(free) + shared.common.shape[-1]], axis=1)
    whitened = _whitened(causes, np.column_stack([rows, system.values]))
    state = np.concatenate([free, np.zeros(shared.common.shape[-1])])
    return WhitenedRecords(state, whitened[:, :-1], whitened[:, -1])


def _whitened(causes: Array, values: Array) -> Array:
    """Values (r, m) for which causes (r, k) of unit variance count as noise."""
    if not causes.shape[1]:
        return values
    factor = np.linalg.cholesky(np.eye(len(causes)) + causes @ causes.T)
    from scipy.linalg import solve_triangular  # noqa: PLC0415 - a tenth of a second

    whitened: Array = solve_triangular(factor, values, lower=True)
    return whitened
