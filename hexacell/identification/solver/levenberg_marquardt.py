"""Levenberg-Marquardt on the free parameters, with a Gaussian prior and reweighting.

Minimised is ``sum r~^T W r~ + (d - d0)^T L (d - d0)``: centred residuals r~ and the prior's
precision L. A trial step is judged under the weights it was made with; an accepted one brings new
weights. The damping follows the ratio of actual to predicted gain (Nielsen's rule: cubic decrease,
doubling increase), scaled by the diagonal of the normal matrix. Where the steps end, the gradient
under the weights of that very point is zero: the weighted estimating equation is solved.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver import measurement_model, nuisance_parameters
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask

CAUTIOUS_DAMPING = 1e-4
NEARLY_NO_DAMPING = 1e-9
SMALLEST_DAMPING = 1e-12
LARGEST_DAMPING = 1e12
FINAL_STEP_MM = 1e-9
ITERATIONS = 200
SEARCHES = 1000
REFUSALS_BEFORE_SINGULAR = 6
LARGEST_AMPLIFICATION = 100.0
"""mm of ball a mm of slider: beyond it a record says nothing, and its linearisation little."""


class Termination(Enum):
    """Why the iteration ended, in a sentence for people."""

    STEP = "the parameters no longer change"
    PRECISION = "the cost cannot be lowered within the precision of the numbers"
    STUCK = "no step lowers the cost"
    SINGULAR = "a record came next to a singularity on the way"
    ITERATIONS = "the largest number of iterations was used"

    @property
    def converged(self) -> bool:
        """Whether the end is a solution."""
        return self in {Termination.STEP, Termination.PRECISION}


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the iteration ended.

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
    """How to search, and when to give up.

    Attributes:
        damping: to begin with.
        step_mm: that counts as none.
        iterations: at most, in one search.
        searches: at most, around singularities (see :mod:`.detour`).
    """

    damping: float
    step_mm: float
    iterations: int = ITERATIONS
    searches: int = SEARCHES


COARSE = SolverOptions(CAUTIOUS_DAMPING, 1e-3)
"""From the drawing, millimetres away, to the neighbourhood of the solution."""

INCREMENTAL = SolverOptions(NEARLY_NO_DAMPING, 1e-3)
"""From the solution of all records but the last."""

FINE = SolverOptions(NEARLY_NO_DAMPING, FINAL_STEP_MM)
"""From the neighbourhood to the solution itself: Gauss-Newton steps unless one fails."""


def solve(
    problem: Problem, precision: Array, *, free: Array, poses: PoseBatch, manner: SolverOptions = COARSE
) -> Solution:
    """Minimise from the free parameters (p,), mm, and poses that close that geometry.

    Args:
        problem: the records and the prior's centre.
        precision: (p, p) of the prior, 1/mm^2; zero for none.
        free: where to start.
        poses: the platform at each record under ``free``.
        manner: of the search.
    """
    search = _Search(problem, precision, manner, measurement_model.predict(problem, free, poses))
    iterations = 0
    ended: Termination | None = None
    while ended is None:
        iterations += 1
        ended = search.advance() if iterations <= manner.iterations else Termination.ITERATIONS
    final = search.linear()
    return Solution(search.now, final.information(), final.cost(), iterations, ended, search.singular)


class _Search:
    """The iterate, its damping, and one step at a time."""

    def __init__(
        self, problem: Problem, precision: Array, manner: SolverOptions, start: measurement_model.Prediction
    ) -> None:
        self.problem = problem
        self.precision = precision
        self.centre = problem.mechanism.convention.free_parameters(problem.prior.centre)
        self.now = start
        self.centring = nuisance_parameters.NuisanceElimination(problem, start.weights)
        self.manner = manner
        self.damping = manner.damping
        self.growth = 2.0
        self.refusals = 0
        self.singular = start.amplification > LARGEST_AMPLIFICATION

    def linear(self) -> nuisance_parameters.ReducedSystem:
        """The linear problem at the iterate."""
        return self.centring.system(self.now.residuals, self.now.jacobian)

    def advance(self) -> Termination | None:
        """Try one step; says so when the search has ended."""
        if self.singular.any():
            return Termination.SINGULAR
        step = _Step.of(self.linear(), self.precision, self.now.free - self.centre, self.damping)
        if np.abs(step.free).max() < self.manner.step_mm and self.damping <= self.manner.damping:
            return Termination.STEP
        trial = measurement_model.evaluate_step(self.problem, self.now, step.free)
        if not trial.found.all():
            return self._refuse(trial.found)
        gain = self._gain(trial.residuals, step)
        if gain.actual > 0.0:
            self._accept(step, trial.poses, gain)
            return None
        return Termination.PRECISION if gain.negligible else self._damp()

    def _accept(self, step: _Step, poses: PoseBatch, gain: _Gain) -> None:
        self.now = measurement_model.predict(self.problem, self.now.free + step.free, poses)
        self.centring = nuisance_parameters.NuisanceElimination(self.problem, self.now.weights)
        self.damping *= max(0.1, 1.0 - (2.0 * gain.ratio - 1.0) ** 3)
        self.damping = max(self.damping, SMALLEST_DAMPING)
        self.growth, self.refusals = 2.0, 0
        self.singular = self.now.amplification > LARGEST_AMPLIFICATION

    def _refuse(self, found: Mask) -> Termination | None:
        self.refusals += 1
        if self.refusals >= REFUSALS_BEFORE_SINGULAR:
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
    def of(
        cls, linear: nuisance_parameters.ReducedSystem, precision: Array, from_centre: Array, damping: float
    ) -> _Step:
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
