"""The statement of accuracy: the largest error over the task poses, with its expanded uncertainty.

The largest error over the poses is not a linear function of the independent effects that are not known.
Its uncertainty is therefore computed by drawing them (JCGM 101, Propagation of distributions using a
Monte Carlo method): U is the half-width about the stated value that holds 95 % of the draws. An effect
whose size was measured with few degrees of freedom is drawn from a t-distribution (JCGM 101, 6.4.9).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.kinematics.rotations import Array

DRAWS = 10_000
SEED = 20_100_101
COVERAGE = 0.95
"""Probability that the stated value is wrong by no more than U."""

COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty of a single value (JCGM 100): about 95 %."""


@dataclass(frozen=True, slots=True)
class LargestError:
    """The largest error over the task poses, and its expanded uncertainty, both in mm or both in deg."""

    value: float
    expanded: float


@dataclass(frozen=True, eq=False)
class TaskErrors:
    """Estimated errors of n task poses, base and platform frames fitted, and what is not known of them.

    Attributes:
        estimated: (n, 6) positions, mm, then rotation vectors, rad.
        effects: (n, 6, k) change of these errors by one standard deviation of each independent effect.
        measured: further effects (n, 6, k), each with the degrees of freedom of its size.
    """

    estimated: Array
    effects: Array
    measured: tuple[tuple[Array, float], ...] = ()

    @cached_property
    def position(self) -> LargestError:
        """Largest position error, mm."""
        return self._largest(slice(0, 3), 1.0)

    @cached_property
    def orientation(self) -> LargestError:
        """Largest orientation error, deg."""
        return self._largest(slice(3, 6), float(np.degrees(1.0)))

    @property
    def worst(self) -> int:
        """Row of the task pose with the largest position error, uncertainty included."""
        squares = (self.estimated[:, :3] ** 2).sum(axis=-1)
        for columns in (self.effects, *(columns for columns, _ in self.measured)):
            squares = squares + (columns[:, :3] ** 2).sum(axis=(1, 2))
        return int(np.argmax(squares))

    def _largest(self, components: slice, factor: float) -> LargestError:
        """The largest error by some components of all poses, in another unit."""
        estimated = factor * self.estimated[:, components]
        value, random = float(np.linalg.norm(estimated, axis=-1).max()), np.random.default_rng(SEED)
        drawn = estimated
        for columns, freedom in ((self.effects, np.inf), *self.measured):
            draws = random.standard_normal((DRAWS, columns.shape[-1]))
            if np.isfinite(freedom):
                draws *= np.sqrt(freedom / random.chisquare(freedom, (DRAWS, 1)))
            drawn = drawn + np.tensordot(draws, factor * columns[:, components], axes=(1, 2))
        largest = np.linalg.norm(drawn, axis=-1).max(axis=-1)
        return LargestError(value, float(np.quantile(np.abs(largest - value), COVERAGE)))


def covariance_factor(covariance: Array) -> Array:
    """A matrix (p, p) L with ``L L^T`` the covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
