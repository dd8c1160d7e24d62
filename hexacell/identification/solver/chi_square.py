"""Whether the residuals are as large as the stated noise makes them.

The chi-square of the residuals has, in the mean, one unit for each record's coordinate, less one
for each unknown of a station, less the trace of C M for the parameters (C their covariance, M the
data's information). That trace is the number of parameters where the data alone determine them; a
parameter that the prior holds takes up less, and the residuals stay larger by that.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.special import chdtr, chdtrc

from hexacell.identification.solver.linearized_solution import LinearizedSolution
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination

SMALLEST_PROBABILITY = 1e-3
RATIOS_THAT_MATTER = (0.9, 1.1)
"""With very many records a percent of noise too much is certain, and of no importance."""


class ChiSquareVerdict(Enum):
    """What the residuals say about the stated noise."""

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
    """

    chi2: float
    expected: float

    @property
    def probability(self) -> float:
        """Of residuals as large as these or larger, if model and stated noise are right."""
        return float(chdtrc(self.expected, self.chi2)) if self.expected > 0.0 else 1.0

    @property
    def ratio(self) -> float:
        """How many times the stated noise the residuals are."""
        return float(np.sqrt(self.chi2 / self.expected)) if self.expected > 0.0 else 1.0

    @property
    def agreement(self) -> ChiSquareVerdict:
        """The verdict."""
        if self.expected < 0.5:
            return ChiSquareVerdict.NOT_EVALUATED
        smallest, largest = RATIOS_THAT_MATTER
        if self.ratio > largest and self.probability < SMALLEST_PROBABILITY:
            return ChiSquareVerdict.TOO_LARGE
        if self.ratio < smallest and chdtr(self.expected, self.chi2) < SMALLEST_PROBABILITY:
            return ChiSquareVerdict.TOO_SMALL
        return ChiSquareVerdict.AGREES

    @property
    def noise_factor(self) -> float:
        """What to multiply every standard deviation by: it is surely larger than by the stated noise."""
        return self.ratio if self.agreement is ChiSquareVerdict.TOO_LARGE else 1.0

    @property
    def sentence(self) -> str:
        """The verdict for people."""
        match self.agreement:
            case ChiSquareVerdict.NOT_EVALUATED:
                return "There are no more records than unknowns: the residuals prove nothing."
            case ChiSquareVerdict.AGREES:
                return "The residuals agree with the stated noise."
            case ChiSquareVerdict.TOO_LARGE:
                return (
                    f"The residuals are {self.ratio:.1f} times the stated noise: the machine does not "
                    "repeat, a gauge is not as it was, or the noise is stated too small."
                )
            case ChiSquareVerdict.TOO_SMALL:
                return (
                    f"The residuals are only {self.ratio:.2f} times the stated noise: it is stated too "
                    "large, and every sigma with it."
                )


def goodness(model: LinearizedSolution) -> ChiSquareTest:
    """The chi-square of an identification and what it should be."""
    problem = model.problem
    system = model.system(NuisanceElimination(problem, model.weights()))
    taken = float(np.sum(model.covariance * system.information()))
    return ChiSquareTest(system.cost(), 3.0 * (problem.records - problem.points) - taken)
