"""The measurement model: residuals of every record, their derivatives and weights.

A record predicts the ball's position P(p, q) by forward kinematics at the measured joint variables q
(Abtahi et al. 2010, eq. 4). Its residual is P minus the measured deviation d. Its weight is the inverse
of its covariance ``G diag(s_encoder^2) G^T + diag(s_gauge^2)``, with ``G = dP/dq`` (generalized least
squares).

A record satisfies ``P - d = c + w x d - k * d + noise``, with the position c of the ball when the point's
gauges were zeroed, the small rotation w of the gauges against the base, and the scale errors k of the
gauges, which are along their axes. All of them are linear, so for given weights their best values are
computed and subtracted, and they never become parameters (variable projection; Golub and Pereyra 1973): c
and w for each point, with a prior on w, and k once for all points, with a prior as well. Coefficients of
terms beside the geometry (:mod:`hexacell.identification.terms`), and increments of a drift
(:mod:`hexacell.identification.problem.random_walk`), are common to all records like k.
"""

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.problem.random_walk import walk_columns
from hexacell.kinematics.forward import ForwardResult, apply_twist, forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import free_sensitivity

WANDERING = 1.5
"""Ratio of two Newton steps beyond which the method wanders about: the legs close nowhere near."""

LARGEST_AMPLIFICATION = 100.0
"""mm of the ball per mm of a slider. Beyond it a record has no information and its linearization fails."""

MOST_UNKNOWN = 1e8
"""Variances of noise that a side which nobody knows counts as at most; with more an inverse is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The measurement model at one geometry, linearized.

    Attributes:
        geometry: of the free parameters, which the poses close.
        residuals: (n, 3), mm: predicted position minus measured deviation, with each point's unknown
            constant.
        weights: (n, 3, 3), 1/mm^2: inverse covariance of one record.
        pose_jacobian: (n, 6, p) of position, mm, and rotation vector, rad, by the free parameters.
        by_joints: (n, 3, 6) of the ball's position by the joint variables.
        mode: (n,) the assembly mode, see :func:`hexacell.kinematics.sensitivity.assembly_mode`.
    """

    free: Array
    geometry: Geometry
    poses: PoseBatch
    residuals: Array
    weights: Array
    pose_jacobian: Array
    by_joints: Array
    mode: Array
    singular: Mask

    @property
    def jacobian(self) -> Array:
        """(n, 3, p) of the residuals by the free parameters."""
        return self.pose_jacobian[:, :3]


def predict(problem: Problem, free: Array, poses: PoseBatch, mode: Array | None = None) -> Prediction:
    """Linearize the measurement model at free parameters (p,), mm, and the poses that close their geometry.

    ``mode`` (n,) is the assembly mode of the poses, if it is known.
    """
    geometry = problem.geometry(free)
    sensitivity = free_sensitivity(problem.mechanism, geometry, poses, problem.joints)
    by_joints = sensitivity.joints[:, :3]
    return Prediction(
        free=free,
        geometry=geometry,
        poses=poses,
        residuals=problem.residuals(poses.positions),
        weights=_weights(problem, by_joints),
        pose_jacobian=sensitivity.free,
        by_joints=by_joints,
        mode=sensitivity.mode if mode is None else mode,
        singular=is_singular(by_joints),
    )


def _weights(problem: Problem, by_joints: Array) -> Array:
    """Inverse covariances (n, 3, 3), 1/mm^2, of records by ``dP/dq`` (n, 3, 6)."""
    terms = problem.terms
    if terms is None or not terms.unknown.any():
        return problem.noise.record_weights(by_joints)
    noise, covariance = problem.noise, problem.noise.record_covariance(by_joints)
    unknown = np.minimum(terms.unknown, MOST_UNKNOWN * max(noise.encoder, noise.gauge_mm) ** 2)
    on_either_side = (by_joints * unknown[:, None, :]) @ np.swapaxes(by_joints, -1, -2)
    return np.asarray(np.linalg.inv(covariance + on_either_side))


def evaluate_step(
    problem: Problem, present: Prediction, step: Array, doubtful: Mask, closed_mm: float
) -> ForwardResult:
    """The poses after a step (p,), mm, of the free parameters, closed up to ``closed_mm``.

    Forward kinematics starts at the linearized poses, and at the present ones where that fails. Records
    (n,) that are ``doubtful`` come first: where one has no pose the others are not looked for, nor missed.
    """
    geometry = problem.geometry(present.free + step)
    poses, found = present.poses, np.ones(problem.records, dtype=bool)
    starts = apply_twist(present.poses, present.pose_jacobian @ step), present.poses
    for some in (doubtful, ~doubtful):
        missing = np.flatnonzero(some)
        for start in starts:
            if len(missing):
                result = forward_kinematics(
                    problem.mechanism,
                    geometry,
                    problem.joints[missing],
                    start[missing],
                    mode=present.mode[missing],
                    tolerance_mm=closed_mm,
                    largest_contraction=WANDERING,
                )
                poses, found[missing] = poses.with_rows(missing, result.poses), result.found
                missing = missing[~result.found]
        if len(missing):
            break
    return ForwardResult(poses, found)


def is_singular(position_by_joints: Array) -> Mask:
    """Whether each record is next to a singularity, by ``dP/dq`` (n, 3, 6)."""
    return np.asarray(np.linalg.norm(position_by_joints, axis=(-2, -1)) > LARGEST_AMPLIFICATION)


@dataclass(frozen=True, slots=True, eq=False)
class ReducedSystem:
    """Whitened rows (r, p) and values (r,) of least squares, those of the priors on w and k included."""

    rows: Array
    values: Array

    def information(self) -> Array:
        """Fisher information of the data on the free parameters (p, p), 1/mm^2."""
        return self.rows.T @ self.rows

    def gradient(self) -> Array:
        """Half the gradient of the cost by the free parameters (p,)."""
        return self.rows.T @ self.values


class NuisanceElimination:
    """The unknowns c, w, k, of drift and terms at their best values, for weights (n, 3, 3), 1/mm^2."""

    def __init__(self, problem: Problem, weights: Array) -> None:
        noise = problem.noise
        self.problem, self._weights, self._stations = problem, weights, problem.stations
        self._turns = noise.alignment > 0.0
        self._design: Array = np.broadcast_to(np.eye(3), (problem.records, 3, 3))  # by c, and by w
        if self._turns:
            by_turn = np.cross(np.eye(3), problem.deviations[:, None])  # in rows
            self._design = np.concatenate([self._design, np.swapaxes(by_turn, -1, -2)], axis=-1)
            normal = problem.group_sums(np.swapaxes(self._design, -1, -2) @ weights @ self._design)
            normal[:, range(3, 6), range(3, 6)] += noise.alignment**-2
        else:
            normal = problem.group_sums(weights)
        self._station_covariance = np.linalg.inv(normal)
        self._sigmas, designs = np.zeros(0), list[Array]()
        if noise.gauge_scale > 0.0:
            designs.append(-problem.gauges * (problem.deviations @ problem.gauges)[:, None, :])
            self._sigmas = np.full(3, noise.gauge_scale)
        if noise.walk.step_mm > 0.0 and problem.records > problem.points:
            designs.append(walk_columns(problem.first_rows, problem.records, noise.walk, problem.times_s))
        if problem.terms is not None:
            designs.append(-problem.terms.columns)
        if designs:
            common = np.concatenate(designs, axis=-1)
            self._sigmas = np.append(self._sigmas, np.ones(common.shape[-1] - len(self._sigmas)))
            self._common_design, self._common_rows = self._without_stations(common)
            normal = self._gram(self._common_design, self._common_rows)
            self.common_covariance = np.linalg.inv(normal + np.diag(self._sigmas**-2))

    def centred(self, values: Array) -> Array:
        """Values (n, 3, ...) less the best c, w and k."""
        return self._reduced(values)[0]

    def system(self, residuals: Array, jacobian: Array) -> ReducedSystem:
        """Residuals (n, 3) and their Jacobian (n, 3, p), centred and whitened."""
        both = np.concatenate([jacobian, residuals[..., None]], axis=-1)
        centred_values, penalties = self._reduced(both)
        factor = np.swapaxes(np.linalg.cholesky(self._weights), -1, -2)
        rows = np.concatenate([(factor @ centred_values).reshape(-1, both.shape[-1]), penalties])
        return ReducedSystem(rows[:, :-1], rows[:, -1])

    def cost(self, residuals: Array) -> float:
        """The weighted sum of squares of centred residuals (n, 3), priors included."""
        r, penalties = self._reduced(residuals)
        return float(np.einsum("ni,nij,nj->", r, self._weights, r) + np.sum(penalties**2))

    def nuisance_covariance(self) -> Array:
        """Covariance (n, 3, 3), mm^2, of what is subtracted from each record."""
        spread, design = self._station_covariance[self._stations], self._design
        taken = design @ spread @ np.swapaxes(design, -1, -2)
        if len(self._sigmas):
            design = self._common_design
            taken = taken + design @ self.common_covariance @ np.swapaxes(design, -1, -2)
        return taken

    def common(self, values: Array) -> Array:
        """The best k, if gauges have any, and coefficients of the terms (m, j), for values (n, 3, j)."""
        return np.asarray(self.common_covariance @ self._gram(*self._without_stations(values)))

    def _reduced(self, values: Array) -> tuple[Array, Array]:
        """Centred values, and the rows (r, k) that the priors add to the sum of squares."""
        reduced, penalties = self._without_stations(values.reshape(*values.shape[:2], -1))
        if len(self._sigmas):
            best = self.common_covariance @ self._gram(reduced, penalties)
            reduced = reduced - self._common_design @ best
            prior = best / self._sigmas[:, None]
            penalties = np.concatenate([penalties - self._common_rows @ best, prior])
        return reduced.reshape(values.shape), penalties

    def _without_stations(self, values: Array) -> tuple[Array, Array]:
        """Values (n, 3, k) less the best c and w of each point, and the rows of the prior on w."""
        if not self._turns:
            means = self._station_covariance @ self.problem.group_sums(self._weights @ values)
            return values - means[self._stations], np.zeros((0, values.shape[-1]))
        transposed = np.swapaxes(self._design, -1, -2)
        best = self._station_covariance @ self.problem.group_sums(transposed @ (self._weights @ values))
        reduced = values - self._design @ best[self._stations]
        return reduced, (best[:, 3:] / self.problem.noise.alignment).reshape(-1, values.shape[-1])

    def _gram(self, values: Array, penalties: Array) -> Array:
        """Weighted products (m, j) of the common design with values that contain no c and w."""
        both = self._common_design, self._weights @ values
        design, weighted = (one.reshape(3 * len(one), one.shape[-1]) for one in both)
        return np.asarray(design.T @ weighted + self._common_rows.T @ penalties)
