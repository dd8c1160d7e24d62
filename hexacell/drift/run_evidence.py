"""What the records of one run say of the free parameters, and what is known by all runs so far.

**One run** is linearized at a geometry near the truth, and the stations' unknowns are eliminated. Beside
the p free parameters, the state x has the k causes of those systematic errors that are the same in all runs
of a machine, in standard deviations: nothing tells them from an unusual geometry in one run, and they
cancel in the difference of two. With whitened rows H and residuals r, predicted less measured, at the state
x0, the cost of x is ``|r + H (x - x0)|^2``. All that later computations need of it are ``H^T H`` and ``H^T
(H x0 - r)``, which are added over runs (information filter; Anderson and Moore, Optimal Filtering, 1979,
section 6.3).

**All runs.** Estimates of several nights share the error of the calibration that they start from, so that a
test of them one by one would alarm on a robot that has not changed. Their innovations do not: what a run
shows beyond what all runs before it predict is independent of these, if nothing changed (Kailath, An
innovations approach to least-squares estimation, IEEE Transactions on Automatic Control 13, 1968, 646-655).
With the information L carried so far, at whose estimate the new evidence has the gradient g, and the
information N of that,

    s = L (L + N)^-1 g        and its covariance        L (L + N)^-1 N,

so that ``d^T s`` over its standard deviation is the score of a change along d, standard normal without one.

**Location.** A step by b along d between two runs adds ``b N d`` to what every run after it weighs. With
the state unknown too, the likelihood is largest at

    b = u / v,    u = d^T sum g,    v = d^T (A - A T^-1 A) d,

over the runs after the step, with their gradients g at the estimate of all runs under no change, their
information A, and the information T of all. The gain ``u^2 / v`` of twice the log-likelihood is largest for
the most likely run and cause (Basseville and Nikiforov, Detection of Abrupt Changes, 1993, section 7.2.4).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.problem.prior import SystematicModel, no_systematic_errors
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.linear_model import systematic_errors
from hexacell.identification.solver.measurement_model import NuisanceElimination, predict
from hexacell.kinematics.rotations import Array

DIFFUSE = 1e2
"""Standard deviation of a free parameter of which nothing is known, mm or rad."""

LEAST_SHARE = 1e-3
"""Share of a run's information on a cause that previous runs must leave, for the run to be counted."""

LIKELY = 3.84
"""Twice the log-likelihood that a step may have less than the likeliest one: 95 % for its time."""


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

    ``weighted`` (s,) is the information (s, s) times the state that fits the run best.
    """

    information: Array
    weighted: Array

    def gradient(self, state: Array) -> Array:
        """Gradient (s,) of the log-likelihood at a state (s,)."""
        return self.weighted - self.information @ state


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
    problem: Problem, free: Array, *, of_this_run: SystematicModel = no_systematic_errors
) -> WhitenedRecords:
    """The records of a problem that have a pose under the geometry of ``free`` parameters (p,), mm.

    They are linearized there, near the truth. The problem's systematic errors are those that all runs of a
    machine share; those ``of_this_run`` are others in each.
    """
    solved = problem.solve_poses(free)
    kept = problem.subset(solved.found)
    prediction = predict(kept, free, solved.poses[np.flatnonzero(solved.found)])
    residuals = prediction.residuals
    shared = systematic_errors(kept, prediction)
    own = systematic_errors(replace(kept, systematic=of_this_run), prediction)
    weights = np.linalg.inv(np.linalg.inv(prediction.weights) + shared.own + own.own)
    jacobian = np.concatenate([prediction.jacobian, shared.common, own.common], axis=-1)
    system = NuisanceElimination(kept, weights).system(residuals, jacobian)
    rows, causes = np.split(system.rows, [len(free) + shared.common.shape[-1]], axis=1)
    whitened = np.column_stack([rows, system.values])
    if causes.shape[1]:  # of unit variance, and noise of this run
        from scipy.linalg import solve_triangular  # noqa: PLC0415 - a tenth of a second

        factor = np.linalg.cholesky(np.eye(len(causes)) + causes @ causes.T)
        whitened = solve_triangular(factor, whitened, lower=True)
    state = np.concatenate([free, np.zeros(shared.common.shape[-1])])
    return WhitenedRecords(state, whitened[:, :-1], whitened[:, -1])


@dataclass(frozen=True, slots=True, eq=False)
class CarriedPosterior(RunEvidence):
    """The evidence of all runs so far, with the prior."""

    @classmethod
    def diffuse(cls, free: int, causes: int) -> "CarriedPosterior":
        """Nothing known of so many free parameters; shared causes have unit variance."""
        return cls(np.diag([DIFFUSE**-2] * free + [1.0] * causes), np.zeros(free + causes))

    @property
    def state(self) -> Array:
        """The estimate (s,)."""
        return np.linalg.solve(self.information, self.weighted)

    def after(self, *runs: RunEvidence) -> "CarriedPosterior":
        """The posterior with some more runs."""
        information = sum((run.information for run in runs), self.information)
        return CarriedPosterior(information, sum((run.weighted for run in runs), self.weighted))

    def scores(self, run: RunEvidence, causes: Array) -> Array:
        """Innovations (m,) of a run by each cause (m, s); NaN where it says nothing of a change.

        They are standard normal, and independent of all before, if the robot has not changed.
        """
        share = np.linalg.solve(self.information + run.information, self.information).T
        score = causes @ (share @ run.gradient(self.state))
        variance = np.einsum("ms,st,mt->m", causes, share @ run.information, causes)
        is_seen = variance > LEAST_SHARE * np.einsum("ms,st,mt->m", causes, run.information, causes)
        return np.where(is_seen, score / np.sqrt(np.where(is_seen, variance, 1.0)), np.nan)

    def forgetting(self, causes: Array) -> "CarriedPosterior":
        """The posterior if the robot may just have changed by any amount along some causes (m, s)."""
        information, weighted = self.information, self.weighted
        for cause in causes:
            along = information @ cause
            taken = along / (DIFFUSE**-2 + float(cause @ along))
            weighted = weighted - taken * float(cause @ weighted)
            information = information - np.outer(taken, along)
        return CarriedPosterior(information, weighted)


@dataclass(frozen=True, slots=True, eq=False)
class StepGains:
    """Steps before each of n runs by each of m causes.

    Attributes:
        gains: (n, m) of twice the log-likelihood.
        changes: (n, m) estimate of the step, in the unit of its cause.
        sigmas: (n, m) one standard deviation of it; infinite where the runs do not see it.
    """

    gains: Array
    changes: Array
    sigmas: Array

    def likely_runs(self, cause: int) -> tuple[int, int]:
        """The first and the last run that a step by this cause may have been before."""
        gains = self.gains[:, cause]
        likely = np.flatnonzero(gains > gains.max() - LIKELY)
        return int(likely[0]), int(likely[-1])


def step_gains(before: CarriedPosterior, runs: Sequence[RunEvidence], causes: Array) -> StepGains:
    """The steps before each of n runs, by each of m causes (m, s); ``before`` is known before the first."""
    total = before.after(*runs)
    state, covariance = total.state, np.linalg.inv(total.information)
    gradient, information = np.zeros(len(state)), np.zeros_like(covariance)
    scores, weights = np.zeros((len(runs), len(causes))), np.zeros((len(runs), len(causes)))
    for place in reversed(range(len(runs))):
        gradient = gradient + runs[place].gradient(state)
        information = information + runs[place].information
        seen = information @ causes.T
        own = np.einsum("ms,sm->m", causes, seen)
        scores[place] = causes @ gradient
        weights[place] = own - np.einsum("sm,st,tm->m", seen, covariance, seen)
        weights[place][weights[place] < LEAST_SHARE * own] = 0.0
    is_seen = weights > 0.0
    safe = np.where(is_seen, weights, 1.0)
    return StepGains(
        gains=np.where(is_seen, scores**2 / safe, 0.0),
        changes=np.where(is_seen, scores / safe, 0.0),
        sigmas=np.where(is_seen, safe**-0.5, np.inf),
    )
