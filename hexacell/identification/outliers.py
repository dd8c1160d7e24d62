"""Gross errors: single records that do not agree with all the others.

Two tests of each record. The one of a shift along one gauge is the sharpest where one gauge was
misread; the one of a shift in any direction finds the rest, a wrong encoder reading for one. Both
are deletion statistics: the record is judged by what the others say about it, however much it pulls
the solution its own way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtri

from hexacell.identification.expansion import Expansion
from hexacell.rotations import Array

FALSE_ALARMS_PER_RECORD = 2e-4
FALSE_ALARMS_PER_FILE = 0.02
"""Whichever is the smaller: a hundred thousand good records should lose none either."""

SMALLEST_REDUNDANCY = 1e-3
"""A record that alone determines something has no residual there to be judged by."""

MEDIAN_OF_CHI2_3 = 2.366
SCATTER_OF_MEDIAN = 1.12
"""Standard deviation of the median of n such values, over that median, times the root of n."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordTests:
    """Tests of n records.

    Attributes:
        along_gauges: (n, 3) squared standardised shift along each gauge; about 1 for a good record.
        in_any_direction: (n,) squared standardised shift; about 3 for a good record.
        scale: variance of the noise over the stated one, where it is surely larger.
    """

    along_gauges: Array
    in_any_direction: Array
    scale: float

    @classmethod
    def of(cls, expansion: Expansion) -> RecordTests:
        """The tests of all records of an expansion."""
        own, gauges = expansion.weights, expansion.problem.gauges
        left = expansion.left
        along_gauges = _along(gauges, expansion.scores, own @ left @ own, own)
        statistic = _in_any_direction(expansion.residuals, left, own)
        return cls(along_gauges, statistic, _scale(statistic))

    def excess(self, found_before: int = 0) -> Array:
        """By how many times (n,) a record's greater statistic exceeds what chance may give it.

        With every error that was found the next one is less surprising: the rate of false alarms
        among all alarms is held (Benjamini and Hochberg 1995).
        """
        records = len(self.in_any_direction)
        rate = min(FALSE_ALARMS_PER_RECORD, FALSE_ALARMS_PER_FILE / records) * (found_before + 1) / 2.0
        along_a_gauge = self.along_gauges.max(axis=-1) / ndtri(rate / 6.0) ** 2
        excess: Array = np.maximum(along_a_gauge, self.in_any_direction / chdtri(3, rate)) / self.scale
        return excess


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
