"""How much of residuals that are too large some cause would explain: score tests of added columns.

A cause adds columns Z to the residuals that its size per unit makes to first order, and unknowns b. Its
score statistic

    gain = r^T M Z (Z^T M Z)^-1 Z^T M r

is the decrease of the chi-square that it would give, with M the weights less what stations and parameters
absorb. A direction of Z that these absorb explains nothing and does not count. A cause with many unknowns
explains some of any residuals; therefore the mean squares per degree of freedom are compared, s^2 before
and after, and the share of the excess that is explained is ``(s0^2 - s1^2) / (s0^2 - 1)``.

Sources: Rao 1948 (score test); Theil, Economic Forecasts and Policy, 1961 (adjusted coefficient of
determination).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.parameters import LEGS, MachinePart
from hexacell.kinematics.rotations import Array, skew
from hexacell.uncertainty.effects import Effect, Placement, Readings
from hexacell.uncertainty.record_effects import errors_of_records

SMALLEST_REMAINDER = 1e-4
"""Of the square of a direction of Z, that stations and parameters must leave: the rest is rounding."""


@dataclass(frozen=True, eq=False)
class ExcessTest:
    """The score tests of columns (n, 3, k) beside the parameters of an identification."""

    found: Identification

    def share_of_columns(self, parts: Iterable[Array]) -> float:
        """The share (0 to 1) of the excess that columns (n, 3, k) explain together."""
        return self.share_of_gain(*self._gain(np.concatenate([*parts], axis=-1)))

    def share_of_gain(self, gain: float, unknowns: int) -> float:
        """The share (0 to 1) that a decrease of the chi-square by some unknowns explains."""
        before = self.found.noise_test
        after = ChiSquareTest(before.chi2 - gain, before.expected - unknowns)
        if before.ratio <= 1.0 or after.expected < 1.0:
            return 0.0
        return float(np.clip((before.ratio**2 - after.ratio**2) / (before.ratio**2 - 1.0), 0.0, 1.0))

    def by_effects(self, *effects: Effect) -> list[Array]:
        """What one unit of each cause of some effects does to the records."""
        return [errors_of_records(effect, self._placement, self._readings) for effect in effects]

    def by_encoders(self) -> list[Array]:
        """Encoders whose scale changes along them."""
        joints = self.found.problem.joints
        bent = (joints - joints.mean(axis=0)) ** 2
        return [self._placement.by_joints(bent[..., None] * np.eye(LEGS))[:, :3]]

    def by_gauges(self) -> list[Array]:
        """Readings that are a linear function of the deviation, stations turned, and zeros that drift."""
        problem = self.found.problem
        since = np.arange(problem.records) - problem.per_record(problem.first_rows.astype(float))
        linear = np.einsum("ij,nk->nijk", np.eye(3), problem.deviations)
        drift = since[:, None, None] * np.eye(3)
        return [
            linear.reshape(problem.records, 3, 9),
            self._at_each_point(skew(problem.deviations)),
            self._at_each_point(drift),
        ]

    def by_expansion(self) -> list[Array]:
        """Each part, and each leg, that expands evenly from the first record to the last."""
        placement = self._placement
        parameters, vector = placement.mechanism.parameters, placement.geometry.vector
        changes = [
            parameters.by_kind({kind.symbol: float(kind.part is part) for kind in parameters.kinds})
            * vector
            for part in MachinePart
        ]
        progress = np.linspace(-0.5, 0.5, len(placement))[:, None, None]
        by_parts = placement.by_parameters(np.stack(changes, axis=-1))
        return [progress * by_parts[:, :3], progress * placement.by_constraints[:, :3]]

    @cached_property
    def _placement(self) -> Placement:
        found = self.found
        return Placement(found.problem.mechanism, found.geometry, found.poses, found.problem.joints)

    @cached_property
    def _readings(self) -> Readings:
        problem = self.found.problem
        return Readings(self.found.poses.rotations, problem.deviations, problem.gauges)

    def _at_each_point(self, columns: Array) -> Array:
        """Columns (n, 3, k) as unknowns of each point (n, 3, k m)."""
        problem = self.found.problem
        at_point = problem.per_record(np.eye(problem.points))
        alone: Array = np.einsum("nij,nm->nijm", columns, at_point).reshape(problem.records, 3, -1)
        return alone

    def _gain(self, columns: Array) -> tuple[float, int]:
        """The decrease of the chi-square, and by how many unknowns."""
        prediction = self.found.prediction
        elimination = NuisanceElimination(self.found.problem, prediction.weights)
        both = np.concatenate([prediction.jacobian, columns], axis=-1)
        system = elimination.system(prediction.residuals, both)
        by_parameters, by_causes = np.split(system.rows, [prediction.jacobian.shape[-1]], axis=1)
        by_causes = by_causes / np.maximum(np.linalg.norm(by_causes, axis=0), 1e-300)
        absorbed = self.found.free_covariance @ (by_parameters.T @ by_causes)
        remaining = by_causes - by_parameters @ absorbed
        values, axes = np.linalg.eigh(by_causes.T @ remaining)
        seen = values > SMALLEST_REMAINDER
        scores = axes[:, seen].T @ (remaining.T @ system.values)
        return float(np.sum(scores**2 / values[seen])), int(np.count_nonzero(seen))
