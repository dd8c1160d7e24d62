"""Score tests of data faults: by how much one more unknown would lower the chi-square.

An unknown b that adds ``Z b`` to the residuals r of a linear model has the estimate and the gain

    b = (Z^T M Z)^-1 Z^T M r,    gain = r^T M Z b,

with M of :class:`.LinearizedModel`, of which only the blocks of the records concerned are needed. Z is

- one record, along one gauge or in any direction: a gross error;
- one constant for a record and all later ones of its point: a shift of the gauges' zero;
- a known change of the readings, with no unknown: a gauge fault. Readings d should have been T d, so that
  the residuals change by ``z = -(T - 1) d`` and the chi-square by ``2 z^T M r + z^T M z``.

Sources: Rao, Proc. Cambridge Phil. Soc. 44, 1948 (score test); Baarda, A testing procedure for use in
geodetic networks, 1968 (data snooping); Cook and Weisberg, Residuals and Influence in Regression, 1982.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.distributions import chi_square_limit, normal_limit
from hexacell.identification.data_faults.hypotheses import (
    GAUGE_FAULTS,
    PENALTY_PER_UNKNOWN,
    FaultHypothesis,
    GaugeFaultHypothesis,
    OutlierHypothesis,
    ZeroShiftHypothesis,
)
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.linear_model import LinearizedModel
from hexacell.kinematics.rotations import Array

FALSE_ALARMS_PER_RECORD = 2e-4
FALSE_ALARMS_PER_FILE = 0.02
"""The smaller rate applies: a file of 100,000 good records must not lose any either."""

WORTH_TESTING = 0.05
"""Probability of the residuals below which zero shifts and gauge faults are tested too."""

FALSE_SHIFTS_PER_FILE = 1e-3

SMALLEST_GAUGE_FAULT_GAIN = 25.0
"""A likelihood ratio of 270,000, for some dozens of gauge faults tested."""

SMALLEST_REDUNDANCY = 1e-3
"""Share of a record's information that the others must determine, or its residual is no evidence."""

MEDIAN_OF_CHI2_3 = 2.366
SCATTER_OF_MEDIAN = 1.12
"""Relative standard deviation of the median of n such values, times the square root of n."""


def rank_hypotheses(
    model: LinearizedModel, goodness: ChiSquareTest, *, found_before: int = 0
) -> list[FaultHypothesis]:
    """The significant hypotheses on the residuals of a model, the most likely first.

    Args:
        model: of the records, around a geometry.
        goodness: the test of their residuals there.
        found_before: how many gross errors were found before.
    """
    statistics = OutlierStatistics.of(model)
    hypotheses: list[FaultHypothesis] = [*_outlier(model, statistics, found_before)]
    if goodness.probability < WORTH_TESTING:
        hypotheses += _zero_shift(model, statistics.scale)
        for hypothesis in score_gauge_faults(model):
            remaining = max(1.0, (goodness.chi2 - hypothesis.gain) / goodness.expected)
            if hypothesis.gain > SMALLEST_GAUGE_FAULT_GAIN * min(statistics.scale, remaining):
                hypotheses.append(hypothesis)
    return sorted(hypotheses, key=lambda hypothesis: hypothesis.cost)


def score_gauge_faults(model: LinearizedModel) -> list[GaugeFaultHypothesis]:
    """Every gauge fault, at all points and at each, with its gain."""
    problem = model.problem
    points = [None, *(int(problem.labels[row, 0]) for row in problem.first_rows)]
    hypotheses = []
    for fault in GAUGE_FAULTS:
        change = -problem.deviations @ (fault.in_base_frame(problem) - np.eye(3)).T
        at_points, at_all = known_change_gains(model, change)
        hypotheses += [
            GaugeFaultHypothesis(gain=gain, unknowns=0, gauge_fault=fault, point=point)
            for point, gain in zip(points, [at_all, *at_points.tolist()], strict=True)
        ]
    return hypotheses


def _outlier(
    model: LinearizedModel, statistics: OutlierStatistics, found_before: int
) -> Iterator[OutlierHypothesis]:
    """The record with the most significant gross error, of one gauge or of any kind."""
    ratio = statistics.threshold_ratio(found_before)
    row = int(np.argmax(ratio))
    if ratio[row] <= 1.0:
        return
    point, orientation = model.problem.labels[row].tolist()
    one_gauge, any_direction = float(statistics.along_gauges[row].max()), float(statistics.omnibus[row])
    is_one_gauge = any_direction - one_gauge < 2.0 * PENALTY_PER_UNKNOWN
    gain, unknowns = (one_gauge, 1) if is_one_gauge else (any_direction, 3)
    yield OutlierHypothesis(gain=gain, unknowns=unknowns, records=((point, orientation),))


def _zero_shift(model: LinearizedModel, scale: float) -> Iterator[ZeroShiftHypothesis]:
    """The most significant shift of the gauges' zero."""
    rows, gains, shifts = zero_shift_statistics(model)
    if not len(rows):
        return
    best = int(np.argmax(gains))
    gain = float(gains[best])
    if (significance := gain / scale / chi_square_limit(3, FALSE_SHIFTS_PER_FILE / len(rows))) > 1.0:
        point, orientation = model.problem.labels[rows[best]].tolist()
        yield ZeroShiftHypothesis(
            gain=gain,
            unknowns=3,
            point=point,
            orientation=orientation,
            shift=shifts[best],
            significance=significance,
        )


@dataclass(frozen=True, slots=True, eq=False)
class OutlierStatistics:
    """Tests of n records for gross errors.

    Attributes:
        along_gauges: (n, 3) squared standardised shift along each gauge; about 1 for a good record.
        omnibus: (n,) squared standardised shift; about 3 for a good record.
        scale: noise variance, by the median record, over the stated one where it is significantly larger,
            else 1.
    """

    along_gauges: Array
    omnibus: Array
    scale: float

    @classmethod
    def of(cls, model: LinearizedModel) -> OutlierStatistics:
        """The tests of all records of a model."""
        weights, gauges = model.weights, model.problem.gauges
        covariance = model.residual_covariance
        information = np.einsum("ia,nij,ja->na", gauges, weights @ covariance @ weights, gauges)
        whole = np.einsum("ia,nij,ja->na", gauges, weights, gauges)
        along_gauges = _squares_over(model.scores @ gauges, information, SMALLEST_REDUNDANCY * whole)
        values, axes = np.linalg.eigh(covariance)
        along = np.einsum("nij,ni->nj", axes, model.residuals)
        smallest = SMALLEST_REDUNDANCY / np.linalg.eigvalsh(weights)[:, -1:]
        omnibus = np.sum(_squares_over(along, values, smallest), axis=-1)
        noise = float(np.median(omnibus)) / MEDIAN_OF_CHI2_3
        is_larger = noise > 1.0 + 4.0 * SCATTER_OF_MEDIAN / np.sqrt(len(omnibus))
        return cls(along_gauges, omnibus, noise if is_larger else 1.0)

    def threshold_ratio(self, found_before: int = 0) -> Array:
        """The larger statistic (n,) of each record over its critical value.

        The false alarm rate grows with the errors found before, so that the share of false alarms
        among all alarms stays constant (Benjamini and Hochberg 1995).
        """
        records = len(self.omnibus)
        rate = min(FALSE_ALARMS_PER_RECORD, FALSE_ALARMS_PER_FILE / records) * (found_before + 1) / 2.0
        along_a_gauge = self.along_gauges.max(axis=-1) / normal_limit(rate / 6.0) ** 2
        in_space = self.omnibus / chi_square_limit(3, rate)
        return np.asarray(np.maximum(along_a_gauge, in_space) / self.scale)


def _squares_over(values: Array, variances: Array, smallest: Array) -> Array:
    """Squares over variances; zero where these are too small for a test."""
    testable = variances > smallest
    return np.asarray(np.where(testable, values**2 / np.where(testable, variances, 1.0), 0.0))


def zero_shift_statistics(model: LinearizedModel) -> tuple[NDArray[np.intp], Array, Array]:
    """Tests of a zero shift right before a record, with at least two records before and after it.

    A single shifted record is a gross error.

    Returns:
        The first record (k,) after each testable shift; the decrease (k,) of the chi-square, about 3 where
        there is no shift; and by how much (k, 3), mm, the gauges x, y and z then read too much.
    """
    problem, weights = model.problem, model.weights
    later = _sums_from(problem, np.ones(problem.records))
    before = problem.per_record(later[problem.first_rows]) - later
    rows = np.flatnonzero((before >= 2) & (later >= 2))
    score = _sums_from(problem, model.scores)[rows]
    weight = _sums_from(problem, weights)[rows]
    by_parameters = _sums_from(problem, weights @ model.jacobian)[rows]
    station = np.linalg.inv(problem.per_record(problem.group_sums(weights))[rows])
    taken = by_parameters @ model.covariance @ np.swapaxes(by_parameters, -1, -2)
    information = weight - weight @ station @ weight - taken
    shift = np.einsum("kij,kj->ki", np.linalg.pinv(information, hermitian=True), score)
    return rows, np.sum(score * shift, axis=-1), -shift @ problem.gauges


def _sums_from(problem: Problem, values: Array) -> Array:
    """Sums (n, ...) over each record and the later ones of its point."""
    before = np.cumsum(values, axis=0) - values
    in_point = before - problem.per_record(before[problem.first_rows])
    return np.asarray(problem.per_record(problem.group_sums(values)) - in_point)


def known_change_gains(model: LinearizedModel, change: Array) -> tuple[Array, float]:
    """The decrease of the chi-square if the residuals change by ``change`` (n, 3), mm.

    For the change at each point alone (m,), and at all of them together.
    """
    problem, weights = model.problem, model.weights
    weighted = np.einsum("nij,nj->ni", weights, change)
    constants = np.linalg.solve(problem.group_sums(weights), problem.group_sums(weighted)[..., None])[
        ..., 0
    ]
    centred = change - problem.per_record(constants)
    score = problem.group_sums(np.sum(change * model.scores, axis=-1))
    squares = problem.group_sums(np.sum(centred * weighted, axis=-1))
    by_parameters = problem.group_sums(np.einsum("nip,ni->np", model.jacobian, weighted))
    taken = np.einsum("mp,pq,mq->m", by_parameters, model.covariance, by_parameters)
    total = by_parameters.sum(axis=0)
    all_squares = squares.sum() - total @ model.covariance @ total
    return -(2.0 * score + squares - taken), -float(2.0 * score.sum() + all_squares)
