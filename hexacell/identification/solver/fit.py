"""The fit of a geometry to records: Levenberg-Marquardt with a Gaussian prior and reweighting.

The cost at free parameters p is

    F(p) = r~^T W r~ + (p - p0)^T L (p - p0),

with the residuals r~ that are left once the unknowns of the stations have their best values, the weights
W of the records, the centre p0 of the prior, and its precision L. One iteration (:func:`_advance`)
linearizes the model at p, eliminates the stations (rows J~), solves ``(N + m diag N) s = -g`` for the
step s with ``N = J~^T J~ + L`` and ``g = J~^T r~ + L (p - p0)``, and finds the poses at p + s in the same
assembly mode. If F falls, under the weights of p, the step is accepted, and the damping m follows the
ratio of actual to predicted gain; otherwise it grows (Nielsen's rule). An accepted step changes the
weights, so that at the end the gradient under the weights of the last iterate is zero.

:func:`fit_regularized` solves twice: the prior of the first solution is released for the second one in
directions that the data determine much better, where it would only bias the result. These are eigenvectors
of the data's information in coordinates in which the prior's covariance is the identity.
:func:`solve_around_singularities` sets records aside that come next to a singularity on the way, or have no
start pose, and restores them at the solution of the others. :func:`solve` iterates.

Sources: Marquardt 1963; Nielsen, Damping Parameter in Marquardt's Method, IMM-REP-1999-05, 1999; Hansen,
Rank-Deficient and Discrete Ill-Posed Problems, 1998 (release of the prior). Setting records aside is this
program's own method.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import (
    NuisanceElimination,
    Prediction,
    ReducedSystem,
    evaluate_step,
    is_singular,
    predict,
)
from hexacell.identification.solver.result import Identification, Solution, Termination
from hexacell.kinematics.forward import TOLERANCE_MM
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import POSITION, free_sensitivity

INITIAL_DAMPING = 1e-4
SMALL_DAMPING = 1e-9
SMALLEST_DAMPING = 1e-12
LARGEST_DAMPING = 1e12

FINAL_STEP_MM = 1e-9
ITERATIONS = 200
SEARCHES = 1000

FAILURES_BEFORE_SINGULAR = 6
"""Steps in a row after which a record has no pose, until it counts as next to a singularity."""

NEGLIGIBLE_GAIN = 1e-13
"""Share of the cost that the numbers cannot resolve."""

RELEASE_RATIO = 9.0
"""Data information over prior information from which the prior is released (sigma: a third)."""

LEAST_REDUNDANCY = 10
"""Equations beyond the unknowns from which the residuals give an estimate of the noise."""

SMALLEST_CHI2 = 1e-6


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """Options of the solver.

    Attributes:
        step_mm: the iteration ends when the largest step is below this; mrad of an angle.
        iterations: the largest number of iterations in one search.
        searches: the largest number of searches around singularities.
        closed_mm: largest constraint of a pose.
        relief: factor of the damping after a step that gains as much as predicted.
    """

    damping: float
    step_mm: float
    iterations: int = ITERATIONS
    searches: int = SEARCHES
    closed_mm: float = TOLERANCE_MM
    relief: float = 0.1


COARSE = SolverOptions(INITIAL_DAMPING, 1e-3)
"""From the drawing, millimetres away, to near the solution."""

QUICK = SolverOptions(0.1, 1e-3, iterations=60, searches=12, closed_mm=1e-8, relief=0.01)
"""Twice the iterations that consistent records need. From the drawing the first steps are no Gauss-Newton
steps, which may lead where legs do not close; poses are closed once more by what follows."""

INCREMENTAL = SolverOptions(SMALL_DAMPING, 1e-3)
"""From the solution without the last record."""

FINE = SolverOptions(SMALL_DAMPING, FINAL_STEP_MM)
"""From near the solution to the solution: Gauss-Newton steps unless one fails."""


def fit_regularized(
    problem: Problem, options: SolverOptions = COARSE, start: Array | None = None
) -> Identification:
    """Fit the usable records with the prior, and release it where the data determine the parameters.

    The ``options`` are for the first of the two solutions, which starts at free parameters ``start`` (p,),
    mm, if not at those of the problem.
    """
    kept, first = solve_around_singularities(problem, problem.prior.precision, options, start)
    # Residuals below the stated noise justify more information than stated: without it, a prior would bias
    # records with hardly any noise.
    redundancy, correction = kept.coordinates - len(first.information), 1.0
    if redundancy >= LEAST_REDUNDANCY:
        correction = max(1.0, redundancy / max(first.chi2, SMALLEST_CHI2))
    # The prior's precision stays in the directions that the data do not determine.
    factor = np.linalg.cholesky(problem.prior.covariance)
    ratios, directions = np.linalg.eigh(factor.T @ (correction * first.information) @ factor)
    unreleased = np.linalg.solve(factor.T, directions[:, ratios < RELEASE_RATIO])
    active_prior = unreleased @ unreleased.T
    return Identification(kept, solve(kept, active_prior, first.prediction, FINE), active_prior)


def solve_around_singularities(
    problem: Problem, precision: Array, options: SolverOptions, start: Array | None = None
) -> tuple[Problem, Solution]:
    """Minimize the cost without records that come next to a singularity: the others, and their solution.

    The ``precision`` (p, p), 1/mm^2, is that of the prior; the solver begins at free parameters ``start``
    (p,), mm, if not at those of the problem.
    """
    if start is not None:
        problem = problem.started_at(start)
    used = problem.has_start_pose.copy()
    free, poses = problem.initial_parameters, problem.start[used]
    restored = np.zeros(problem.records, dtype=bool)
    for search in itertools.count(1):
        kept = problem.subset(used)
        solution = solve(kept, precision, predict(kept, free, poses), options)
        if search == options.searches:
            break
        free, poses = solution.prediction.free, solution.prediction.poses
        if solution.termination is Termination.SINGULAR and not solution.singular.all():
            used[np.flatnonzero(used)[solution.singular]] = False
            poses = poses[~solution.singular]
            continue
        aside = ~used & ~restored
        if not aside.any():
            break
        restorable, their_poses = _restorable(problem, solution.prediction.geometry, aside)
        if not restorable.any():
            break
        every = problem.start.with_rows(used, poses).with_rows(restorable, their_poses)
        used, restored = used | restorable, restored | restorable
        poses = every[used]
    return kept, solution


def _restorable(problem: Problem, geometry: Geometry, aside: Mask) -> tuple[Mask, PoseBatch]:
    """Which of the records set aside are clear of singularities at a geometry, and their poses."""
    joints = problem.joints[aside]
    solved = problem.commands[aside].solve_poses(geometry, joints)
    sensitivity = free_sensitivity(problem.mechanism, geometry, solved.poses, joints, POSITION)
    clear = solved.found & ~is_singular(sensitivity.joints)
    restorable = np.zeros(problem.records, dtype=bool)
    restorable[aside] = clear
    return restorable, solved.poses[clear]


def solve(problem: Problem, precision: Array, start: Prediction, options: SolverOptions) -> Solution:
    """Minimize the cost, from the model of all records at some free parameters.

    The ``precision`` (p, p), 1/mm^2, is that of the prior; zero for no prior.
    """
    now = _Iterate.at(problem, precision, start, options.damping)
    iterations, ended = 0, None
    while ended is None:
        iterations += 1
        following = _advance(now, options) if iterations <= options.iterations else Termination.ITERATIONS
        if isinstance(following, Termination):
            ended = following
        else:
            now = following
    information, values = now.linear.information(), now.linear.values
    return Solution(now.prediction, information, float(values @ values), iterations, ended, now.singular)


@dataclass(frozen=True, slots=True, eq=False)
class _Iterate:
    """The model at the parameters of one iteration, and the damping of the next step.

    Attributes:
        linear: the whitened rows and values without the unknowns of the stations.
        growth: the factor of the damping if the next step fails.
        failures: steps in a row after which a record had no pose.
        singular: (n,) the records that are next to a singularity, or had no pose too often.
        missing: (n,) the records that had no pose after the step before.
        is_last: whether no further step can lower the cost within the precision of the numbers.
    """

    problem: Problem
    precision: Array
    prediction: Prediction
    elimination: NuisanceElimination
    linear: ReducedSystem
    damping: float
    singular: Mask
    missing: Mask
    growth: float = 2.0
    failures: int = 0
    is_last: bool = False

    @classmethod
    def at(cls, problem: Problem, precision: Array, prediction: Prediction, damping: float) -> "_Iterate":
        elimination = NuisanceElimination(problem, prediction.weights)
        linear = elimination.system(prediction.residuals, prediction.jacobian)
        masks = prediction.singular, np.zeros(problem.records, dtype=bool)
        return cls(problem, precision, prediction, elimination, linear, damping, *masks)

    def from_centre(self, step: Array | float = 0.0) -> Array:
        """The parameters less the prior's centre (p,), mm, after a step."""
        difference: Array = self.prediction.free - self.problem.prior.free
        return difference + step

    def cost(self, residuals: Array, from_centre: Array) -> float:
        """F for residuals (n, 3), mm, under the weights of this iterate."""
        return float(self.elimination.cost(residuals) + from_centre @ self.precision @ from_centre)

    def damped(self) -> "_Iterate | Termination":
        """These parameters with more damping."""
        damping = self.damping * self.growth
        if damping > LARGEST_DAMPING:
            return Termination.STUCK
        return replace(self, damping=damping, growth=2.0 * self.growth)


def _advance(now: _Iterate, options: SolverOptions) -> _Iterate | Termination:
    """Try one step: the next iterate, or why the iteration has ended."""
    if now.singular.any() or now.is_last:
        return Termination.SINGULAR if now.singular.any() else Termination.PRECISION
    step, predicted = _damped_step(now)
    largest = float(np.abs(step / now.problem.like_a_mm).max())
    if largest < options.step_mm and now.damping <= options.damping:
        return Termination.STEP
    trial = evaluate_step(now.problem, now.prediction, step, now.missing, options.closed_mm)
    if not trial.found.all():
        failures, missing = now.failures + 1, ~trial.found
        singular = missing if failures >= FAILURES_BEFORE_SINGULAR else now.singular
        return replace(now, failures=failures, missing=missing, singular=singular).damped()
    cost = now.cost(now.prediction.residuals, now.from_centre())
    actual = cost - now.cost(now.problem.residuals(trial.poses.positions), now.from_centre(step))
    if actual > 0.0:
        ratio = actual / predicted if predicted > 0.0 else 0.0
        return _accepted(now, step, trial.poses, ratio, options.relief)
    if predicted > NEGLIGIBLE_GAIN * max(cost, 1e-12):
        return now.damped()
    # The numbers cannot resolve by how much the cost falls, but the gradient is exact to many more digits.
    return replace(_accepted(now, step, trial.poses, 1.0, options.relief), is_last=True)


def _damped_step(now: _Iterate) -> tuple[Array, float]:
    """The step (p,), mm, and by how much the linear model predicts that it lowers the cost."""
    normal = now.linear.information() + now.precision
    gradient = now.linear.gradient() + now.precision @ now.from_centre()
    scaling = now.damping * np.diag(normal)
    step = -np.linalg.solve(normal + np.diag(scaling), gradient)
    return step, float(step @ (scaling * step) - step @ gradient)


def _accepted(now: _Iterate, step: Array, poses: PoseBatch, ratio: float, relief: float) -> _Iterate:
    """The iterate after a step, by the ratio of its actual to its predicted gain."""
    damping = max(now.damping * max(relief, 1.0 - (2.0 * ratio - 1.0) ** 3), SMALLEST_DAMPING)
    before = now.prediction
    prediction = predict(now.problem, before.free + step, poses, before.mode)
    return _Iterate.at(now.problem, now.precision, prediction, damping)
