"""What an identification says of the terms beside the geometry: coefficients and their uncertainty."""

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import NuisanceElimination, Prediction
from hexacell.identification.terms.taken import TakenTerms, mean_of, spread_of
from hexacell.identification.terms.term import ModelTerm
from hexacell.kinematics.corrections import CorrectionKind, Corrections
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True, eq=False)
class TermEstimates:
    """The coefficients of m terms, six each, one after the other.

    Attributes:
        values: (6 m,), each in its term's unit.
        covariance: (6 m, 6 m) of them.
        with_parameters: (6 m, p) their covariance with the free parameters of the geometry.
    """

    terms: tuple[ModelTerm, ...]
    values: Array
    covariance: Array
    with_parameters: Array

    @classmethod
    def at(
        cls, problem: Problem, taken: TakenTerms, prediction: Prediction, covariance: Array
    ) -> "TermEstimates":
        """The best coefficients of the terms ``taken`` at a minimum of the cost.

        The ``covariance`` (p, p), mm^2, is that of the free parameters there.
        """
        elimination = NuisanceElimination(problem, prediction.weights)
        causes = taken.columns.shape[-1]
        values = elimination.common(prediction.residuals[..., None])[-causes:, 0]
        # With other parameters, other coefficients are best.
        by_parameters = elimination.common(prediction.jacobian)[-causes:]
        crossed, spread = by_parameters @ covariance, spread_of(taken.terms)
        own = elimination.common_covariance[-causes:, -causes:] + crossed @ by_parameters.T
        best = mean_of(taken.terms) + spread @ values
        return cls(taken.terms, best, spread @ own @ spread.T, spread @ crossed)

    @classmethod
    def expected(cls, terms: tuple[ModelTerm, ...], parameters: int) -> "TermEstimates":
        """What is known of terms before records, beside a number of free parameters."""
        spread, mean = spread_of(terms), mean_of(terms)
        return cls(terms, mean, spread @ spread.T, np.zeros((len(mean), parameters)))

    def beside_encoders(self, directions: Array) -> Array:
        """How far joints (6,) stand from where encoders show them, by the side from which they came."""
        beside = np.zeros(len(directions))
        for term in self.terms:
            if term.name == CorrectionKind.BACKLASH:
                beside = beside - 0.5 * self.of(term.name)[0] * directions
        return beside

    def of(self, name: str) -> tuple[Array, Array]:
        """Coefficients (6,) of one term, and one standard deviation (6,) of each."""
        rows = self.rows([term.name for term in self.terms].index(name))
        return self.values[rows], np.sqrt(np.diag(self.covariance)[rows])

    def rows(self, number: int) -> slice:
        """Where the coefficients of a term are in ``values``."""
        legs = len(self.values) // len(self.terms)
        return slice(number * legs, (number + 1) * legs)

    def left_by(self, corrections: Corrections) -> Array:
        """What of the coefficients (6 m,) a controller with some corrections does not correct."""
        return np.asarray(
            self.values
            - np.concatenate([corrections.of(term.name)[: len(term.mean)] for term in self.terms])
        )

    def joint_covariance(self, of_parameters: Array) -> Array:
        """Covariance (p + 6 m, p + 6 m) of the free parameters (p, p) and the coefficients."""
        return np.block([[of_parameters, self.with_parameters.T], [self.with_parameters, self.covariance]])
