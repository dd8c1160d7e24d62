"""What a fault hypothesis is, and the fit of a problem that is corrected for some of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareVerdict
from hexacell.identification.solver.regularized_fit import QUICK, fit_regularized
from hexacell.identification.solver.result import Identification

PENALTY_PER_UNKNOWN = 10.0
"""By how much a hypothesis must lower the chi-square for each number that it is free to choose."""

SUFFICIENT_DECREASE = 20.0
"""Of the mean square residual, for a hypothesis to be accepted although the fit is not yet consistent."""

SETTLING_DECREASE = 400.0
SETTLING_MISFIT = 4.0
"""Of the mean square residual, and what it must be, for a hypothesis to need no comparison with others."""

LARGEST_TRUSTED_RATIO = 10.0
"""Residuals over the stated noise up to which first-order tests around the solution are valid."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultHypothesis(ABC):
    """One explanation of records that disagree with the others; equal however it was found.

    Attributes:
        gain: the decrease of the chi-square if it is true, to first order.
        unknowns: how many numbers it is free to choose.
    """

    gain: float = field(compare=False)
    unknowns: int = field(compare=False)

    @property
    def cost(self) -> float:
        """The penalized gain, negative: the most likely hypothesis has the lowest cost."""
        return PENALTY_PER_UNKNOWN * self.unknowns - self.gain

    @abstractmethod
    def corrected(self, problem: Problem) -> Problem:
        """The problem without the fault: readings corrected, or records left out."""

    def trial(self, current: CorrectedFit) -> CorrectedFit | None:
        """The fit corrected for this fault as well; none if the records contradict the hypothesis."""
        return current.corrected_for(self)

    def confirmed(self, current: CorrectedFit) -> CorrectedFit | None:
        """The same where the current fit is reliable: none if the trial does not confirm the hypothesis."""
        return self.trial(current)


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedFit:
    """A fit of records that are corrected for data faults.

    ``original`` has all records as measured, ``problem`` those after correction. The solver may have left
    out some of these, next to a singularity. ``faults`` are in the order of selection.
    """

    original: Problem
    problem: Problem
    fit: Identification
    faults: tuple[FaultHypothesis, ...] = ()

    @classmethod
    def uncorrected(cls, problem: Problem) -> CorrectedFit:
        """The fit of all records as measured."""
        return cls(problem, problem, fit_regularized(problem, QUICK))

    def corrected_for(self, hypothesis: FaultHypothesis) -> CorrectedFit:
        """The fit after correction for one more fault."""
        problem = hypothesis.corrected(self.problem)
        fit = fit_regularized(problem, QUICK)
        return replace(self, problem=problem, fit=fit, faults=(*self.faults, hypothesis))

    def converged(self) -> CorrectedFit:
        """The same with the solver's full number of iterations where the quick fit was cut short."""
        if self.fit.converged:
            return self
        return replace(self, fit=fit_regularized(self.problem))

    @property
    def lost(self) -> int:
        """How many records the solver left out."""
        return self.problem.records - self.fit.records

    @property
    def is_reliable(self) -> bool:
        """Whether the solution is good enough for first-order tests around it."""
        is_near = self.fit.goodness.ratio <= LARGEST_TRUSTED_RATIO
        return not self.lost and self.fit.converged and is_near

    @property
    def is_consistent(self) -> bool:
        """Whether all records agree with the stated noise."""
        return self.is_reliable and self.fit.goodness.agreement is not ChiSquareVerdict.TOO_LARGE

    @property
    def misfit(self) -> float:
        """The mean square residual; a lost record counts as one at the largest trusted ratio."""
        squares = self.fit.goodness.ratio**2 * self.fit.records + LARGEST_TRUSTED_RATIO**2 * self.lost
        return squares / self.problem.records

    def is_better_by_far_than(self, other: CorrectedFit) -> bool:
        """Whether it explains so much more that it is right although something else is still wrong."""
        return self.misfit < other.misfit / SUFFICIENT_DECREASE

    def settles(self, other: CorrectedFit) -> bool:
        """Whether no other hypothesis can explain it better: it agrees, or an imperfect machine is left."""
        is_near_noise = self.is_reliable and self.misfit <= SETTLING_MISFIT
        return self.is_consistent or (is_near_noise and self.misfit < other.misfit / SETTLING_DECREASE)
