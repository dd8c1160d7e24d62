"""Chi-square test: are the residuals as large as the stated noise makes them?

The expected chi-square is the number of measured coordinates, less the unknown constants of the stations,
less the trace of C M for the parameters (C their covariance, M the information of the data): the effective
degrees of freedom of ridge regression (Hastie, Tibshirani and Friedman, The Elements of Statistical
Learning, 2nd ed. 2009). A parameter that the prior determines counts less than one.

Where the noise was measured by repeated visits it is known with as many degrees of freedom as these have.
The residuals are then compared with it by an F-test, as of lack of fit against pure error (Draper and
Smith, Applied Regression Analysis, 3rd ed. 1998, chapter 2).
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from hexacell.distributions import chi_square_exceedance, variance_ratio_exceedance

SMALLEST_PROBABILITY = 1e-3
CONTRADICTED_RATIO = 10.0
"""Residuals over the stated noise from which noise cannot explain them, only a wrong model or data."""

RATIOS_THAT_MATTER = (0.9, 1.1)
"""Ratios in between agree: with very many records a percent too much is significant but irrelevant."""


class ChiSquareVerdict(Enum):
    """Whether the residuals agree with the stated noise."""

    AGREES = "agrees"
    TOO_LARGE = "too large"
    TOO_SMALL = "too small"
    NOT_EVALUATED = "not evaluated"


@dataclass(frozen=True, slots=True)
class ChiSquareTest:
    """The chi-square test of the residuals.

    Attributes:
        chi2: weighted sum of squares of the residuals.
        expected: its mean if model and stated noise are right; the degrees of freedom, where the
            data determine every parameter.
        noise_freedom: degrees of freedom with which the noise was measured; infinite where it is stated.
    """

    chi2: float
    expected: float
    noise_freedom: float = np.inf

    @property
    def probability(self) -> float:
        """Probability of residuals at least this large, if model and stated noise are right."""
        if self.expected <= 0.0:
            return 1.0
        if np.isinf(self.noise_freedom):
            return chi_square_exceedance(self.expected, self.chi2)
        return variance_ratio_exceedance(self.expected, self.noise_freedom, self.chi2 / self.expected)

    @property
    def ratio(self) -> float:
        """The residuals over the stated noise."""
        return float(np.sqrt(self.chi2 / self.expected)) if self.expected > 0.0 else 1.0

    @property
    def agreement(self) -> ChiSquareVerdict:
        """The verdict."""
        if self.expected < 0.5:
            return ChiSquareVerdict.NOT_EVALUATED
        smallest, largest = RATIOS_THAT_MATTER
        if self.ratio > largest and self.probability < SMALLEST_PROBABILITY:
            return ChiSquareVerdict.TOO_LARGE
        if self.ratio < smallest and 1.0 - self.probability < SMALLEST_PROBABILITY:
            return ChiSquareVerdict.TOO_SMALL
        return ChiSquareVerdict.AGREES

    @property
    def is_explained(self) -> bool:
        """Whether the noise explains the residuals; false without redundancy."""
        return self.agreement in {ChiSquareVerdict.AGREES, ChiSquareVerdict.TOO_SMALL}

    @property
    def noise_factor(self) -> float:
        """Factor for every standard deviation, above 1 where the residuals are significantly too large."""
        return self.ratio if self.agreement is ChiSquareVerdict.TOO_LARGE else 1.0
