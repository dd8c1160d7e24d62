"""Levenberg-Marquardt on the free parameters, with a Gaussian prior and reweighting.

The cost is ``sum r~^T W r~ + (d - d0)^T L (d - d0)`` with the centred residuals r~ and the precision
L of the prior. A trial step is evaluated with the weights of the current iterate; an accepted step
updates the weights. The damping, scaled by the diagonal of the normal matrix, depends on the ratio of
actual to predicted gain (Nielsen's rule: cubic decrease, doubling increase). At the end the gradient
under the weights of the last iterate is zero, which solves the weighted estimating equation.

Sources: Marquardt 1963; Nielsen, Damping Parameter in Marquardt's Method, IMM-REP-1999-05, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination, ReducedSystem
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

INITIAL_DAMPING = 1e-4
SMALL_DAMPING = 1e-9
SMALLEST_DAMPING = 1e-12
LARGEST_DAMPING = 1e12
FINAL_STEP_MM = 1e-9
ITERATIONS = 200
SEARCHES = 1000
REJECTIONS_BEFORE_SINGULAR = 6


class Termination(Enum):
    """Why the iteration ended, for people."""

    STEP = "the parameters no longer change"
    PRECISION = "the cost cannot be lowered within the precision of the numbers"
    STUCK = "no step lowers the cost"
    SINGULAR = "a record came next to a singularity on the way"
    ITERATIONS = "the largest number of iterations was used"

    @property
    def converged(self) -> bool:
        """Whether the iteration ended at a minimum."""
        return self in {Termination.STEP, Termination.PRECISION}


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The last iterate.

    Attributes:
        prediction: the model at the solution.
        information: Fisher information of the data alone (p, p), 1/mm^2.
        chi2: weighted sum of squares of the centred residuals.
        singular: (n,) bool, the records that ended the iteration with ``SINGULAR``.
    """

    prediction: measurement_model.Prediction
    information: Array
    chi2: float
    iterations: int
    termination: Termination
    singular: Mask

    @property
    def free(self) -> Array:
        """Free parameters (p,), mm."""
        return self.prediction.free


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """Options of the solver.

    Attributes:
        damping: initial damping.
        step_mm: the iteration ends when the largest step is below this; mrad of an angle.
        iterations: the largest number of iterations in one search.
        searches: the largest number of searches around singularities (:mod:`.singular_records`).
    """

    damping: float
    step_mm: float
    iterations: int = ITERATIONS
    searches: int = SEARCHES


COARSE = SolverOptions(INITIAL_DAMPING, 1e-3)
"""From the drawing, millimetres away, to near the solution."""

INCREMENTAL = SolverOptions(SMALL_DAMPING, 1e-3)
"""From the solution without the last record."""

FINE = SolverOptions(SMALL_DAMPING, FINAL_STEP_MM)
"""From near the solution to the solution: Gauss-Newton steps unless one fails."""


def solve(
    problem: Problem, precision: Array, *, free: Array, poses: PoseBatch, options: SolverOptions = COARSE
) -> Solution:
    """Minimize the cost from the free parameters (p,), mm, and poses that close that geometry.

    Args:
        problem: the records and the prior's centre.
        precision: (p, p) of the prior, 1/mm^2; zero for none.
        free: the start.
        poses: the platform at each record under ``free``.
        options: of the solver.
    """
    search = _Search(problem, precision, options, measurement_model.predict(problem, free, poses))
    iterations = 0
    ended: Termination | None = None
    while ended is None:
        iterations += 1
        ended = search.advance() if iterations <= options.iterations else Termination.ITERATIONS
    final = search.linear()
    return Solution(search.now, final.information(), final.cost(), iterations, ended, search.singular)


class _Search:
    """The iterate, its damping, and one step at a time."""

    def __init__(
        self,
        problem: Problem,
        precision: Array,
        options: SolverOptions,
        start: measurement_model.Prediction,
    ) -> None:
        self.problem = problem
        self.precision = precision
        self.centre = problem.prior.free
        self.now = start
        self.centring = NuisanceElimination(problem, start.weights)
        self._linear: ReducedSystem | None = None
        self.options = options
        self.damping = options.damping
        self.growth = 2.0
        self.rejections = 0
        self.singular = start.singular

    def linear(self) -> ReducedSystem:
        """The linear problem at the iterate."""
        if self._linear is None:
            self._linear = self.centring.system(self.now.residuals, self.now.jacobian)
        return self._linear

    def advance(self) -> Termination | None:
        """Try one step; returns why the search has ended, if it has."""
        if self.singular.any():
            return Termination.SINGULAR
        step = _Step.of(self.linear(), self.precision, self.now.free - self.centre, self.damping)
        largest = float(np.abs(step.free / self.problem.like_a_mm).max())
        if largest < self.options.step_mm and self.damping <= self.options.damping:
            return Termination.STEP
        trial = measurement_model.evaluate_step(self.problem, self.now, step.free)
        if not trial.found.all():
            return self._reject(trial.found)
        gain = self._gain(trial.poses.positions - self.problem.deviations, step)
        if gain.actual > 0.0:
            self._accept(step, trial.poses, gain)
            return None
        return Termination.PRECISION if gain.negligible else self._damp()

    def _accept(self, step: _Step, poses: PoseBatch, gain: _Gain) -> None:
        self.now = measurement_model.predict(self.problem, self.now.free + step.free, poses)
        self.centring = NuisanceElimination(self.problem, self.now.weights)
        self._linear = None
        self.damping *= max(0.1, 1.0 - (2.0 * gain.ratio - 1.0) ** 3)
        self.damping = max(self.damping, SMALLEST_DAMPING)
        self.growth, self.rejections = 2.0, 0
        self.singular = self.now.singular

    def _reject(self, found: Mask) -> Termination | None:
        self.rejections += 1
        if self.rejections >= REJECTIONS_BEFORE_SINGULAR:
            self.singular = ~found
        return self._damp()

    def _damp(self) -> Termination | None:
        self.damping *= self.growth
        self.growth *= 2.0
        return Termination.STUCK if self.damping > LARGEST_DAMPING else None

    def _gain(self, trial_residuals: Array, step: _Step) -> _Gain:
        before = self.now.free - self.centre
        after = before + step.free
        old = self.centring.cost(self.now.residuals) + before @ self.precision @ before
        new = self.centring.cost(trial_residuals) + after @ self.precision @ after
        return _Gain(float(old - new), step.predicted_gain, float(old))


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    free: Array
    predicted_gain: float

    @classmethod
    def of(cls, linear: ReducedSystem, precision: Array, from_centre: Array, damping: float) -> _Step:
        normal = linear.information() + precision
        gradient = linear.gradient() + precision @ from_centre
        scaling = damping * np.diag(normal)
        step = -np.linalg.solve(normal + np.diag(scaling), gradient)
        return cls(step, float(step @ (scaling * step) - step @ gradient))


@dataclass(frozen=True, slots=True)
class _Gain:
    actual: float
    predicted: float
    cost: float

    @property
    def ratio(self) -> float:
        return self.actual / self.predicted if self.predicted > 0.0 else 0.0

    @property
    def negligible(self) -> bool:
        return self.predicted <= 1e-13 * max(self.cost, 1e-12)
