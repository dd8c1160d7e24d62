"""The noise of a record by everything that a run measured twice.

A few visits of one reference show the noise only roughly. At the end of each set its reference is read once
more: what the encoders do not explain of the change is the noise of two readings. All together are one
estimate of pure error, which is compared with the noise V that the run counts with.

What is more may be of all readings, ``f^2 V``, or of joints that stop beside what their encoders show,
``V + x^2 G G^T``: the one with the larger likelihood counts. Where only readings that are far apart in time
differ more, the gauges drift: after n readings by ``V + s^2 n I``, a random walk.

Source: Draper and Smith, Applied Regression Analysis, 3rd ed. 1998, chapter 2 (pure error).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hexacell.distributions import chi_square_exceedance
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Array, Mask
from hexacell.noise.allowances import ReferenceChange
from hexacell.noise.approach_scatter import RepeatedApproaches
from hexacell.robot.model import Robot
from hexacell.uncertainty.effect_kinds import with_measured_stops

SIGNIFICANCE = 0.003
"""Probability of the noise that is counted with below which the repeats show that it is larger.

Of the repeats and the residuals of the fit together it is that below which stops that no encoder sees count
at work: residuals are many, so that few machines have such and are not noticed. Twice it is the share of
healthy machines of which either is said falsely (:mod:`~hexacell.verdict.scatter_evidence`); scatter as
large as the noise has a probability of less than a millionth."""

LEAST_FREEDOM = 9
"""Fewer degrees of freedom say nothing of use."""

DRIFTS = 0.01
"""Probability of the changes at the ends of sets, by noise alone, below which they may be of a drift."""

FEWEST_SETS = 2
"""One set that does not close may be of a gauge that slipped."""

FEWEST = 5.0
"""Degrees of freedom that a size has at least: the likelihood of a small one has no peak to tell them."""

NO_RESIDUALS = ChiSquareTest(0.0, 0.0)
SIZES = np.geomspace(1e-2, 1e3, 400)
"""Sizes of stops that are tried, as multiples of the noise of the encoders."""


@dataclass(frozen=True, slots=True)
class MoreScatter:
    """Scatter of one kind beside the noise, one standard deviation, and how well it is known.

    ``better`` is the logarithm of their likelihood, less that of noise of all readings.
    """

    size: float
    freedom: float
    better: float


@dataclass(frozen=True, eq=False)
class Repeats:
    """What repeated readings show of the noise that a run counts with.

    Attributes:
        changes: of readings at one pose, each with its covariance by that noise.
        is_measured: whether that noise was measured by some of them, not stated.
        seen_freedom: degrees of freedom of the stops that the encoders show.
        residuals: of a fit with that noise, if there is one.
        significance: the probability below which they show more than the noise.
    """

    changes: tuple[ReferenceChange, ...]
    is_measured: bool = False
    seen_freedom: float = np.inf
    residuals: ChiSquareTest = NO_RESIDUALS
    significance: float = SIGNIFICANCE

    @classmethod
    def of(
        cls,
        approaches: RepeatedApproaches | None,
        changes: Sequence[ReferenceChange],
        noise: Noise,
        found: Identification | None = None,
        *,
        significance: float = SIGNIFICANCE,
    ) -> "Repeats":
        """By visits of one reference, changes of readings at others, and what was found with that noise."""
        seen = np.inf if approaches is None else float(noise.joint_count * (approaches.visits - 1))
        is_measured = approaches is not None and approaches.source is not None
        is_of_fit = found is not None and found.problem.noise.encoder <= noise.encoder * (1.0 + 1e-6)
        goodness = found.goodness if found and is_of_fit else NO_RESIDUALS
        return cls(tuple(changes), is_measured, seen, goodness, significance)

    @property
    def freedom(self) -> float:
        """Degrees of freedom of all changes."""
        return 3.0 * len(self.changes)

    @cached_property
    def chi2(self) -> float:
        """The chi-square of all changes under the noise that is counted with."""
        return float(np.sum(self._chi_squares))

    def applied_to(self, noise: Noise) -> Noise:
        """The noise as the repeats show it; what is stated stays unless they contradict it."""
        if not self._is_larger():
            return replace(noise, freedom=self.freedom) if self.is_measured else noise
        stops = self.unseen_stops(noise)
        if stops.better > 0.0:
            encoders = np.hypot(noise.encoders, stops.size).tolist()
            return replace(noise.with_devices(encoders, noise.gauges_mm.tolist()), freedom=stops.freedom)
        return replace(noise.scaled(self._factor), freedom=self.freedom)

    def unseen_stops(self, noise: Noise) -> MoreScatter:
        """Where joints stop beside what their encoders show, as far as the ``noise`` has no room for it.

        It counts at work even where noise of all readings explains the changes better: that is the worst.
        """
        if not (self._is_larger() or self._is_larger(self.residuals)):
            return MoreScatter(0.0, self.freedom, 0.0)
        return self._likeliest(noise.encoder * SIZES, np.stack([one.by_stops for one in self.changes]))

    def show_drift(self, noise: Noise) -> bool:
        """Whether the ends of sets, and visits in short order, show a drift better than other scatter.

        All sets must, but for the one that shows it most: that may be of something else.
        """
        ends = self._ends
        if ends.all() or ends.sum() < FEWEST_SETS:
            return False
        chi2 = np.sort(self._chi_squares[ends])[:-1]
        if chi_square_exceedance(3.0 * len(chi2), float(chi2.sum())) >= DRIFTS:
            return False
        stops = self._likeliest(noise.encoder * SIZES, np.stack([one.by_stops for one in self.changes]))
        return self._walk.better > max(0.0, stops.better)

    @property
    def drift_mm(self) -> float:
        """How far gauges drift along each axis from one reading to the next, one standard deviation."""
        ends = np.flatnonzero(self._ends)
        return replace(self, changes=tuple(self.changes[row] for row in ends))._walk.size

    @property
    def _ends(self) -> Mask:
        return np.array([one.readings > 0 for one in self.changes])

    @property
    def _walk(self) -> MoreScatter:
        readings = np.array([one.readings for one in self.changes])
        unit = float(np.sqrt(np.mean(np.trace(self._covariances, axis1=1, axis2=2)) / 3.0))
        return self._likeliest(unit * SIZES, readings[:, None, None] * np.eye(3))

    def _likeliest(self, sizes: Array, squares: Array) -> MoreScatter:
        """The likeliest of sizes (s,) by what the square of one does to each change (n, 3, 3), mm^2."""
        covariances = self._covariances + (sizes**2)[:, None, None, None] * squares
        inverses = np.linalg.inv(covariances)
        misfit = np.einsum("ni,snij,nj->s", self._shown, inverses, self._shown)
        costs = misfit + np.linalg.slogdet(covariances)[1].sum(axis=-1)
        best = int(np.argmin(costs))
        by_factor = self.freedom * (2.0 * np.log(self._factor) + 1.0)
        of_all = np.linalg.slogdet(self._covariances)[1].sum() + by_factor
        better = 0.5 * float(of_all - costs[best])
        weighted = sizes[best] ** 2 * (inverses[best] @ squares)
        freedom = float(np.einsum("nij,nji->", weighted, weighted))
        return MoreScatter(float(sizes[best]), max(freedom, FEWEST), better)

    def applied_to_robot(self, robot: Robot) -> Robot:
        """The robot with that noise, and with what its stops do at work."""
        unseen = self.unseen_stops(robot.noise)
        effects = with_measured_stops(robot.effects, 1e3 * unseen.size, unseen.freedom, self.seen_freedom)
        return replace(robot, noise=self.applied_to(robot.noise), effects=effects)

    def _is_larger(self, residuals: ChiSquareTest = NO_RESIDUALS) -> bool:
        if self.freedom < LEAST_FREEDOM:
            return False
        freedom, chi2 = self.freedom + residuals.expected, self.chi2 + residuals.chi2
        return chi_square_exceedance(freedom, chi2) < self.significance

    @property
    def _factor(self) -> float:
        return max(1.0, float(np.sqrt(self.chi2 / self.freedom)))

    @property
    def _chi_squares(self) -> Array:
        solved = np.linalg.solve(self._covariances, self._shown[..., None])[..., 0]
        return np.asarray(np.sum(self._shown * solved, axis=-1))

    @cached_property
    def _shown(self) -> Array:
        return np.array([one.unexplained_mm for one in self.changes])

    @cached_property
    def _covariances(self) -> Array:
        return np.stack([one.covariance + one.by_drift for one in self.changes])
