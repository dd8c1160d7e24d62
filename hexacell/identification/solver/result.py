"""The result of an identification: geometry, covariance, and what is wrong with the data."""

from dataclasses import dataclass
from enum import Enum, StrEnum
from functools import cached_property

import numpy as np

from hexacell.errors import IdentifiabilityError
from hexacell.identification.placement import RecordPlacement
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.linear_model import LinearCosts, LinearizedModel
from hexacell.identification.solver.measurement_model import NuisanceElimination, Prediction
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.identification.terms.term import TermFinding
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.measurements.records import Deviation, RecordId

UNDETERMINED_RATIO = 0.5
"""Share of the prior standard deviation above which a parameter was not determined by the data."""

STRONG_CORRELATION = 0.9

GAUGES = "xyz"


class DataFaultKind(StrEnum):
    """What is wrong with records."""

    GROSS_ERROR = "gross error"
    EXCHANGED = "exchanged gauges"
    REVERSED = "reversed gauge"
    INCHES = "inches"
    UNIT = "another unit"
    ZERO_SHIFT = "slipped zero"
    MISMATCHED_JOINTS = "joint variables of another pose"
    SINGULAR = "next to a singularity"


@dataclass(frozen=True, slots=True)
class DataFault:
    """Records that disagree with the others, and why.

    Attributes:
        sentence: what is wrong and how it shows, for people.
        gauges: the gauges concerned, of ``xyz``; empty if no single one is at fault.
        left_out: the records left out; empty where the data are refused.
        offset_mm: what the gauges x, y and z of a record read too much; None where that is unknown.
    """

    kind: DataFaultKind
    sentence: str
    action: str
    gauges: str = ""
    left_out: tuple[RecordId, ...] = ()
    offset_mm: Deviation | None = None

    def __str__(self) -> str:
        return f"{self.sentence}. {self.action}."


class GaugeFaultError(IdentifiabilityError):
    """Readings with a data fault that cannot be left out; a geometry fitted to them would be wrong."""

    def __init__(self, fault: DataFault) -> None:
        self.fault = fault
        super().__init__(fault.sentence, action=fault.action)


class Termination(Enum):
    """Why the iteration ended, for people."""

    STEP = "the parameters no longer change"
    PRECISION = "the cost cannot be lowered within the precision of the numbers"
    STUCK = "no step lowers the cost"
    SINGULAR = "a record came next to a singularity on the way"
    ITERATIONS = "the largest number of iterations was used"

    @property
    def converged(self) -> bool:
        """Whether the iteration ended at a minimum."""
        return self in {Termination.STEP, Termination.PRECISION}


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The last iterate of the solver.

    Attributes:
        information: Fisher information of the data alone (p, p), 1/mm^2.
        chi2: weighted sum of squares of the centred residuals.
        singular: (n,) bool, the records that ended the iteration with ``SINGULAR``.
    """

    prediction: Prediction
    information: Array
    chi2: float
    iterations: int
    termination: Termination
    singular: Mask


@dataclass(frozen=True, slots=True, eq=False)
class GeometryEstimate:
    """An identified geometry with the covariance (P, P), mm^2, of its parameters."""

    geometry: Geometry
    covariance: Array
    termination: Termination


@dataclass(frozen=True, slots=True)
class CorrelatedPair:
    """The names of two free parameters, e.g. ``l3`` and ``B3z``, and their correlation."""

    first: str
    second: str
    correlation: float


@dataclass(frozen=True, eq=False)
class Identification:
    """The identified geometry, its covariance, and how it was found.

    Attributes:
        problem: the records that were used.
        solution: the solver's last iterate.
        active_prior: precision (p, p), 1/mm^2, of the prior where it was not released.
        tried_terms: what was found of the terms beside the geometry that were offered.
    """

    problem: Problem
    solution: Solution
    active_prior: Array
    data_faults: tuple[DataFault, ...] = ()
    tried_terms: tuple[TermFinding, ...] = ()

    @property
    def prediction(self) -> Prediction:
        """The measurement model at the identified geometry."""
        return self.solution.prediction

    @property
    def free(self) -> Array:
        """The free parameters (p,), mm."""
        return self.prediction.free

    @cached_property
    def free_covariance(self) -> Array:
        """Covariance (p, p), mm^2, of the free parameters."""
        covariance = np.linalg.inv(self.solution.information + self.active_prior)
        return 0.5 * (covariance + covariance.T)  # an inverse is symmetric to rounding only

    @cached_property
    def geometry(self) -> Geometry:
        """The geometry in the mechanism's frame convention."""
        return self.problem.geometry(self.free)

    @cached_property
    def covariance(self) -> Array:
        """Covariance (P, P), mm^2, of all parameters; zero for what the frame convention fixes."""
        return self.problem.basis @ self.free_covariance @ self.problem.basis.T

    @property
    def sigma(self) -> Array:
        """Standard deviations (P,), mm, of the parameters; zero for what the convention fixes."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def prior_sigma(self) -> Array:
        """Standard deviations (P,), mm, of the parameters before measuring."""
        return self.problem.basis @ self.problem.prior.sigma

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that the data hardly determine: their sigma is still near the prior's.

        A kind with a default, such as errors of scale, is known well enough beforehand where records say no
        more.
        """
        parameters = self.geometry.parameters
        is_drawn = np.array([one.kind.default is None for one in parameters.parameters])
        undetermined = self.sigma > UNDETERMINED_RATIO * self.prior_sigma
        rows = np.flatnonzero(undetermined & is_drawn & (self.prior_sigma > 0.0))
        return tuple(parameters.names[row] for row in rows)

    @property
    def estimate(self) -> GeometryEstimate:
        """The geometry with its uncertainty."""
        return GeometryEstimate(self.geometry, self.covariance, self.termination)

    @property
    def poses(self) -> PoseBatch:
        """Poses of the platform at the records, under the identified geometry."""
        return self.prediction.poses

    @property
    def records(self) -> int:
        """How many records were used."""
        return self.problem.records

    @property
    def residual_rms_mm(self) -> float:
        """Root mean square of the centred residuals of the deviations."""
        elimination = NuisanceElimination(self.problem, self.prediction.weights)
        return float(np.sqrt(np.mean(elimination.centred(self.prediction.residuals) ** 2)))

    @property
    def chi2(self) -> float:
        """Weighted sum of squares of the centred residuals."""
        return self.solution.chi2

    @property
    def dof(self) -> int:
        """Equations less parameters: the expected chi-square if the data determine every parameter."""
        return self.problem.coordinates - len(self.free)

    @property
    def noise_test(self) -> ChiSquareTest:
        """The chi-square test of the residuals of a machine that has no error but the noise."""
        trace = float(np.sum(self.free_covariance * self.solution.information))
        return ChiSquareTest(self.chi2, self.problem.coordinates - trace, self.problem.noise.freedom)

    @cached_property
    def goodness(self) -> ChiSquareTest:
        """The chi-square test of the residuals, which the stated systematic errors may enlarge."""
        costs = LinearCosts.at(self.problem, self.prediction)
        return self.noise_test if costs.are_of_noise else costs.residual_test(self.active_prior)

    @cached_property
    def placement(self) -> RecordPlacement:
        """The robot at the records under the identified geometry."""
        return self.problem.measured_at(self.free, self.poses)

    @cached_property
    def terms(self) -> TermEstimates | None:
        """What the records say of the terms beside the geometry; None where it has none."""
        if (taken := self.problem.terms) is None:
            return None
        return TermEstimates.at(self.problem, taken, self.prediction, self.free_covariance)

    @property
    def linear_model(self) -> LinearizedModel:
        """The linear model of the records at the solution, for tests of its residuals."""
        return LinearizedModel.at_minimum(self.problem, self.prediction, self.free_covariance)

    def strongly_correlated(self, above: float = STRONG_CORRELATION) -> tuple[CorrelatedPair, ...]:
        """Pairs of free parameters with an absolute correlation above a limit, the strongest first.

        The difference or sum of two such parameters is known well and each of them poorly. The geometry may
        still be accurate, but a change identified in one of the two may be a change of the other.
        """
        names = self.problem.mechanism.convention.free_names
        sigma = np.sqrt(np.diag(self.free_covariance))
        correlation = self.free_covariance / np.outer(sigma, sigma)
        rows, columns = np.triu_indices(len(names), 1)
        order = np.argsort(-np.abs(correlation[rows, columns]), kind="stable")
        return tuple(
            CorrelatedPair(names[i], names[j], float(correlation[i, j]))
            for i, j in zip(rows[order], columns[order], strict=True)
            if abs(correlation[i, j]) > above
        )

    @property
    def log_marginal_likelihood(self) -> float:
        """Logarithm of the likelihood of the records under the prior of their problem, but for a constant.

        The integral over the parameters is Laplace's approximation at the estimate: half the sum of the
        squared residuals, the squared distance from the prior's centre, and ``log det(1 + C I)`` with the
        prior's covariance C and the information I of the records, all with a minus sign.
        """
        prior, information = self.problem.prior, self.solution.information
        squares = self.chi2 + prior.squared_distance(self.free)
        volume = np.linalg.slogdet(np.eye(len(information)) + prior.covariance @ information)[1]
        return -0.5 * float(squares + volume)

    @property
    def termination(self) -> Termination:
        """Why the solver ended."""
        return self.solution.termination

    @property
    def left_out(self) -> tuple[tuple[RecordId, DataFault], ...]:
        """The records left out, each with its fault."""
        return tuple((record, fault) for fault in self.data_faults for record in fault.left_out)
