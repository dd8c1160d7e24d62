"""A fit of records that are corrected for data faults: whether it can be relied on, and is better."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.data_faults import hypotheses
from hexacell.identification.data_faults.deletion_tests import DeletionTest, deletion_tests
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import ChiSquareVerdict
from hexacell.identification.solver.fit import COARSE, QUICK, SolverOptions, fit_regularized
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import RecordId

SUFFICIENT_DECREASE = 20.0
"""Factor of the mean square residual for a hypothesis to count although the fit is not yet consistent."""

SETTLING_DECREASE = 400.0
SETTLING_MISFIT = 4.0
"""Factor and largest mean square residual for a hypothesis to need no comparison with others."""

LARGEST_TRUSTED_RATIO = 10.0
"""Residuals over the stated noise up to which first-order tests around the solution are valid."""

LARGEST_MEAN_SQUARE = 3.0
"""Largest mean square difference from the drawing, in sigma, of a solution that may be the robot."""


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedFit:
    """A fit of records that are corrected for data faults.

    Attributes:
        original: all records as measured.
        problem: the records after correction.
        fit: of those; the solver may have left out some of them, next to a singularity.
        faults: what was corrected, in the order of selection.
    """

    original: Problem
    problem: Problem
    fit: Identification
    faults: tuple[hypotheses.FaultHypothesis, ...] = ()

    @classmethod
    def uncorrected(cls, problem: Problem, options: SolverOptions = QUICK) -> CorrectedFit:
        """The fit of all records as measured."""
        return cls.fitted(problem, problem, options=options)

    @classmethod
    def fitted(
        cls,
        original: Problem,
        problem: Problem,
        faults: tuple[hypotheses.FaultHypothesis, ...] = (),
        options: SolverOptions = QUICK,
        start: Array | None = None,
    ) -> CorrectedFit:
        """Fit the records ``problem``, which are corrected for some faults."""
        return cls(original, problem, fit_regularized(problem, options, start), faults)

    @property
    def rejected(self) -> list[RecordId]:
        """The records rejected for gross errors."""
        outliers = (fault for fault in self.faults if isinstance(fault, hypotheses.OutlierHypothesis))
        return [record for outlier in outliers for record in outlier.records]

    @property
    def zero_shifts(self) -> dict[hypotheses.ZeroShiftHypothesis, list[RecordId]]:
        """The shifts of the gauges' zero that were corrected, each with all records after it."""
        ids = np.array(self.original.record_ids)
        shifts = [fault for fault in self.faults if isinstance(fault, hypotheses.ZeroShiftHypothesis)]
        return {shift: [*map(tuple, ids[shift.rows(self.original)].tolist())] for shift in shifts}

    @property
    def lost(self) -> int:
        """How many records the solver left out."""
        return self.problem.records - self.fit.records

    @property
    def is_reliable(self) -> bool:
        """Whether the solution is good enough for first-order tests around it."""
        is_near = self.fit.goodness.ratio <= LARGEST_TRUSTED_RATIO
        return not self.lost and self.fit.termination.converged and is_near

    @property
    def is_consistent(self) -> bool:
        """Whether all records agree with the stated noise."""
        return self.is_reliable and self.fit.goodness.agreement is not ChiSquareVerdict.TOO_LARGE

    @property
    def is_plausible(self) -> bool:
        """Whether it is of all records, and within the tolerances, however large the residuals are."""
        prior = self.problem.prior
        is_near = prior.squared_distance(self.fit.free) <= LARGEST_MEAN_SQUARE * len(prior.free)
        return not self.lost and self.fit.termination.converged and is_near

    @property
    def misfit(self) -> float:
        """The mean square residual; a lost record counts as one at the largest trusted ratio."""
        squares = self.fit.goodness.ratio**2 * self.fit.records + LARGEST_TRUSTED_RATIO**2 * self.lost
        return squares / self.problem.records

    def misfit_beside(self, other: CorrectedFit) -> float:
        """The misfit on the same records as another fit: those that are lost here alone count as there."""
        further = max(0, self.lost - other.lost) / self.problem.records
        return self.misfit + further * max(0.0, other.fit.goodness.ratio**2 - LARGEST_TRUSTED_RATIO**2)

    def is_better_by_far_than(self, other: CorrectedFit) -> bool:
        """Whether it explains so much more that it is right although something else is still wrong."""
        return self.misfit_beside(other) < other.misfit / SUFFICIENT_DECREASE

    def replaces(self, other: CorrectedFit) -> bool:
        """Whether it is plausible, and the other one, with as many unknowns, is not or leaves far more."""
        return self.is_plausible and not (other.is_plausible and not self.is_better_by_far_than(other))

    def settles(self, other: CorrectedFit) -> bool:
        """Whether no other hypothesis can explain it better: it agrees, or an imperfect machine is left."""
        is_near_noise = self.is_reliable and self.misfit <= SETTLING_MISFIT
        return self.is_consistent or (is_near_noise and self.misfit < other.misfit / SETTLING_DECREASE)

    def likely_hypotheses(self) -> list[hypotheses.FaultHypothesis]:
        """What may be wrong, the most likely first."""
        return hypotheses.rank_hypotheses(
            self.problem, self.fit, found_before=len(self.rejected), is_trusted=self.is_reliable
        )

    def deletion_tests(self) -> dict[RecordId, DeletionTest]:
        """Tests of all records that the fit does without, but for those that only a zero shift concerns."""
        shifted = {record for after in self.zero_shifts.values() for record in after}
        return deletion_tests(self.original, self.fit, without=shifted - {*self.rejected})

    def only_for(self, faults: tuple[hypotheses.FaultHypothesis, ...]) -> CorrectedFit:
        """The fit of all records as measured after correction for some faults, from this solution."""
        problem = self.original
        for fault in faults:
            problem = fault.corrected(problem)
        return self.fitted(self.original, problem, faults, COARSE, self.fit.free)
