"""Tests of records for gross errors: how far each is from what all the others predict.

Sources: Baarda, A testing procedure for use in geodetic networks, 1968 (data snooping); Cook and Weisberg,
Residuals and Influence in Regression, 1982.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from hexacell.distributions import chi_square_limit, normal_limit
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.linear_model import LinearizedModel
from hexacell.identification.solver.measurement_model import predict
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import RecordId

FALSE_ALARMS_PER_RECORD = 2e-4
FALSE_ALARMS_PER_FILE = 0.02
"""The smaller rate applies: a file of 100,000 good records must not lose any either."""

SMALLEST_REDUNDANCY = 1e-3
"""Share of a record's information that the others must determine, or its residual is no evidence."""

MEDIAN_OF_CHI2_3 = 2.366
SCATTER_OF_MEDIAN = 1.12
"""Relative standard deviation of the median of n such values, times the square root of n."""


def model_at(
    problem: Problem, free: Array, active_prior: Array, among: Collection[RecordId] | None = None
) -> LinearizedModel | None:
    """The linear model around a geometry of the records that have poses there, clear of singularities.

    ``free`` (p,), mm, are the parameters of the geometry, and ``active_prior`` (p, p), 1/mm^2, is the
    precision of the prior where it was not released. None if no record is left ``among`` those that count.
    """
    started = problem.started_at(free)
    usable = started.has_start_pose if among is None else started.has_start_pose & problem.mask_of(among)
    some = started.subset(usable)
    prediction = predict(some, some.initial_parameters, some.start)
    if prediction.singular.all():
        return None
    if prediction.singular.any():
        some = some.subset(~prediction.singular)
        prediction = predict(some, some.initial_parameters, some.start)
    return LinearizedModel.around(some, prediction, active_prior)


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
