"""Gross errors: single records that do not agree with all the others.

Two tests of each record. The one of a shift along one gauge is the sharpest where one gauge was
misread; the one of a shift in any direction finds the rest, a wrong encoder reading for one. Both
are deletion statistics: the record is judged by what the others say about it, however much it pulls
the solution its own way.

A slipped zero: from some record of a point on, the gauges show a constant more than before.

The residuals to first order, and the test of one more unknown in them.
# MERGED-DOC
With residuals r, their Jacobian J and weights W, all centred, an unknown b that adds ``Z b`` to the
residuals is estimated, next to the parameters, by
# MERGED-DOC
    b = (Z^T M Z)^-1 Z^T M r,    M = W - W (A + J C J^T) W,
# MERGED-DOC
A what the stations and the gauges' scale absorb, C the parameters' covariance. Estimating it lowers
the chi-square by ``r^T M Z b``; a b that is known beforehand lowers it by less. For a test
neither a second solution nor the whole of M is needed: ``M r = W r`` where r is already the least
there is, and of M only the blocks of the records concerned.
# MERGED-DOC
Source: added-variable (score) tests of linear models; Cook and Weisberg, Residuals and Influence
in Regression, 1982, chapter 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtri

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import Prediction
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination
from hexacell.identification.solver.regularized_fit import Fit
from hexacell.kinematics.rotations import Array

FALSE_ALARMS_PER_RECORD = 2e-4
FALSE_ALARMS_PER_FILE = 0.02
"""Whichever is the smaller: a hundred thousand good records should lose none either."""

SMALLEST_REDUNDANCY = 1e-3
"""A record that alone determines something has no residual there to be judged by."""

MEDIAN_OF_CHI2_3 = 2.366
SCATTER_OF_MEDIAN = 1.12
"""Standard deviation of the median of n such values, over that median, times the root of n."""


@dataclass(frozen=True, slots=True, eq=False)
class OutlierStatistics:
    """Tests of n records.

    Attributes:
        along_gauges: (n, 3) squared standardised shift along each gauge; about 1 for a good record.
        omnibus: (n,) squared standardised shift; about 3 for a good record.
        scale: variance of the noise over the stated one, where it is surely larger.
    """

    along_gauges: Array
    omnibus: Array
    scale: float

    @classmethod
    def of(cls, expansion: LinearizedModel) -> OutlierStatistics:
        """The tests of all records of an expansion."""
        own, gauges = expansion.weights, expansion.problem.gauges
        left = expansion.residual_covariance
        along_gauges = _along(gauges, expansion.scores, own @ left @ own, own)
        statistic = _in_any_direction(expansion.residuals, left, own)
        return cls(along_gauges, statistic, _scale(statistic))

    def threshold_ratio(self, found_before: int = 0) -> Array:
        """By how many times (n,) a record's greater statistic exceeds what chance may give it.

        With every error that was found the next one is less surprising: the rate of false alarms
        among all alarms is held (Benjamini and Hochberg 1995).
        """
        records = len(self.omnibus)
        rate = min(FALSE_ALARMS_PER_RECORD, FALSE_ALARMS_PER_FILE / records) * (found_before + 1) / 2.0
        along_a_gauge = self.along_gauges.max(axis=-1) / ndtri(rate / 6.0) ** 2
        threshold_ratio: Array = np.maximum(along_a_gauge, self.omnibus / chdtri(3, rate)) / self.scale
        return threshold_ratio


def _along(gauges: Array, scores: Array, block: Array, own: Array) -> Array:
    score = scores @ gauges
    information = np.einsum("ia,nij,ja->na", gauges, block, gauges)
    judged = information > SMALLEST_REDUNDANCY * np.einsum("ia,nij,ja->na", gauges, own, gauges)
    tests: Array = np.where(judged, score**2 / np.where(judged, information, 1.0), 0.0)
    return tests


def _in_any_direction(residuals: Array, left: Array, own: Array) -> Array:
    values, axes = np.linalg.eigh(left)
    along = np.einsum("nij,ni->nj", axes, residuals)
    judged = values > SMALLEST_REDUNDANCY / np.linalg.eigvalsh(own)[:, -1:]
    statistic: Array = np.sum(np.where(judged, along**2 / np.where(judged, values, 1.0), 0.0), axis=-1)
    return statistic


def _scale(statistic: Array) -> float:
    """The stated noise is believed unless the median record contradicts it beyond chance."""
    ratio = float(np.median(statistic)) / MEDIAN_OF_CHI2_3
    return ratio if ratio > 1.0 + 4.0 * SCATTER_OF_MEDIAN / np.sqrt(len(statistic)) else 1.0


@dataclass(frozen=True, slots=True, eq=False)
class ZeroShiftStatistics:
    """Tests of a slip right before each of n records, at least two records before and after it.

    Attributes:
        rows: (k,) the first record after each slip that can be tested.
        gains: (k,) by how much the slip would lower the chi-square; about 3 where there is none.
        shifts: (k, 3), mm, what the gauges x, y and z would show more.
    """

    rows: NDArray[np.intp]
    gains: Array
    shifts: Array

    @classmethod
    def of(cls, expansion: LinearizedModel) -> ZeroShiftStatistics:
        """All slips that the records of an expansion could show."""
        problem, weights = expansion.problem, expansion.weights
        rows = _testable(problem.first_rows, problem.records)
        score = _sums_from(problem.first_rows, expansion.scores)[rows]
        weight = _sums_from(problem.first_rows, weights)[rows]
        by_parameters = _sums_from(problem.first_rows, weights @ expansion.jacobian)[rows]
        whole = np.linalg.inv(problem.per_record(problem.group_sums(weights))[rows])
        taken = by_parameters @ expansion.covariance @ np.swapaxes(by_parameters, -1, -2)
        information = weight - weight @ whole @ weight - taken
        shift = np.einsum("kij,kj->ki", np.linalg.pinv(information, hermitian=True), score)
        return cls(rows, np.sum(score * shift, axis=-1), -shift @ problem.gauges)


def _testable(first_rows: NDArray[np.intp], records: int) -> NDArray[np.intp]:
    """A lone first or last record that is shifted is a gross error, and found as such."""
    ends = np.append(first_rows[1:], records)
    spans = [np.arange(first + 2, end - 1) for first, end in zip(first_rows, ends, strict=True)]
    return np.concatenate(spans) if spans else np.zeros(0, dtype=np.intp)


def _sums_from(first_rows: NDArray[np.intp], values: Array) -> Array:
    """Sums (n, ...) over each record and the later ones of its point."""
    totals = np.add.reduceat(values, first_rows, axis=0)
    lengths = np.diff(np.append(first_rows, len(values)))
    before = np.cumsum(values, axis=0) - values
    at_start = np.repeat(before[first_rows], lengths, axis=0)
    sums: Array = np.repeat(totals, lengths, axis=0) - (before - at_start)
    return sums


@dataclass(frozen=True, slots=True, eq=False)
class LinearizedModel:
    """The linear model of some records, at its own solution.

    Attributes:
        problem: the records.
        weights: (n, 3, 3), 1/mm^2.
        residuals: (n, 3), mm, centred: predicted position less measured deviation.
        jacobian: (n, 3, p), centred.
        covariance: of the free parameters (p, p), mm^2.
        nuisance_covariance: (n, 3, 3), mm^2, the covariance of what centring takes from each record.
    """

    problem: Problem
    weights: Array
    residuals: Array
    jacobian: Array
    covariance: Array
    nuisance_covariance: Array

    @classmethod
    def at_solution(cls, fit: Fit) -> LinearizedModel:
        """Around a fit, where no step is left to be made."""
        return cls._of(fit.problem, fit.solution.prediction, fit.covariance)

    @classmethod
    def around(cls, problem: Problem, prediction: Prediction, held: Array) -> LinearizedModel:
        """Around any geometry: what its linear problem leaves; ``held`` is the prior's precision."""
        system = NuisanceElimination(problem, prediction.weights).system(
            prediction.residuals, prediction.jacobian
        )
        covariance = np.linalg.inv(system.information() + held)
        from_centre = prediction.free - problem.mechanism.convention.free_parameters(problem.prior.centre)
        step = -covariance @ (system.gradient() + held @ from_centre)
        return cls._of(problem, prediction, covariance, step)

    @classmethod
    def _of(
        cls, problem: Problem, prediction: Prediction, covariance: Array, step: Array | None = None
    ) -> LinearizedModel:
        centring = NuisanceElimination(problem, prediction.weights)
        residuals, jacobian = centring.centred(prediction.residuals), centring.centred(prediction.jacobian)
        if step is not None:
            residuals = residuals + jacobian @ step
        return cls(
            problem, prediction.weights, residuals, jacobian, covariance, centring.nuisance_covariance()
        )

    @property
    def scores(self) -> Array:
        """``W r`` (n, 3), 1/mm."""
        scores: Array = np.einsum("nij,nj->ni", self.weights, self.residuals)
        return scores

    @property
    def residual_covariance(self) -> Array:
        """Covariance (n, 3, 3), mm^2, of each residual, and ``W left W`` is each record's block of M."""
        taken = self.jacobian @ self.covariance @ np.swapaxes(self.jacobian, -1, -2)
        remaining: Array = np.linalg.inv(self.weights) - self.nuisance_covariance - taken
        return remaining

    @property
    def chi2(self) -> float:
        """Weighted sum of squares of the residuals."""
        return float(np.sum(self.scores * self.residuals))
