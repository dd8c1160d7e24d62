"""First-order tests around a geometry other than a solution: around the drawing, for one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from hexacell.identification import model
from hexacell.identification.causes import Cause, GrossErrors, labels_of, likeliest
from hexacell.identification.expansion import Expansion
from hexacell.identification.fit import Fit
from hexacell.identification.goodness import Goodness
from hexacell.identification.judgement import poses_at
from hexacell.identification.levenberg_marquardt import LARGEST_AMPLIFICATION
from hexacell.identification.misreadings import Suspect, suspects
from hexacell.identification.outliers import RecordTests
from hexacell.identification.problem import Problem
from hexacell.pose import Poses
from hexacell.rotations import Array, Mask

TRIMMED_SHARE = 0.25
SURPRISING = float(chdtri(3, 1e-4))


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A geometry to expand the model around.

    Attributes:
        free: its free parameters (p,), mm.
        held: precision (p, p), 1/mm^2, of the prior there.
        poses: that close it, as far as they were ``found``.
    """

    problem: Problem
    free: Array
    held: Array
    poses: Poses
    found: Mask

    @classmethod
    def beginning(cls, problem: Problem) -> Place:
        """Where the search begins, as a rule the drawing, with the prior in full."""
        held = np.linalg.inv(problem.prior.covariance)
        return cls(problem, problem.begin, held, problem.start, problem.startable)

    @classmethod
    def solution(cls, problem: Problem, fit: Fit) -> Place:
        """A solution, at the records that it lost too."""
        poses, found = poses_at(problem, fit)
        return cls(problem, fit.solution.free, fit.held, poses, found)

    def likeliest(self) -> list[Cause]:
        """What may have spoilt the records, the likeliest first."""
        expansion = self._expansion(self.found)
        if expansion is None:
            return []
        problem = expansion.problem
        return likeliest(expansion, Goodness(expansion.chi2, 3.0 * (problem.records - problem.points)))

    def misreadings(self) -> list[Suspect]:
        """All misreadings, the one that would gain most first."""
        expansion = self._expansion(self.found)
        found = [] if expansion is None else suspects(expansion)
        return sorted(found, key=lambda suspect: -suspect.gain)

    def gross_errors(self) -> GrossErrors | None:
        """All records at once that stand out; whether rightly will be seen once they are left out."""
        kept = self.found.copy()
        while np.count_nonzero(~kept) <= TRIMMED_SHARE * self.problem.records:
            worst = self._worst(kept)
            if worst is None:
                left_out = labels_of(self.problem.keeping(~kept))
                return GrossErrors(tuple(left_out), 0.0, 0) if left_out else None
            kept &= np.any(self.problem.labels != worst, axis=1)
        return None

    def _worst(self, kept: Mask) -> Array | None:
        """The label (2,) of the record that stands out most; none if none does."""
        expansion = self._expansion(kept)
        if expansion is None:
            return None
        tests = RecordTests.of(expansion)
        worst = int(np.argmax(tests.in_any_direction))
        stands_out = tests.in_any_direction[worst] > SURPRISING * tests.scale
        return expansion.problem.labels[worst] if stands_out else None

    def _expansion(self, kept: Mask) -> Expansion | None:
        """The expansion in those of some records (n,) that stand clear of singularities."""
        rows = np.flatnonzero(kept)
        prediction = model.predict(self.problem.keeping(kept), self.free, self.poses[rows])
        rows = rows[prediction.amplification < LARGEST_AMPLIFICATION]
        if not len(rows):
            return None
        clear = np.zeros_like(kept)
        clear[rows] = True
        some = self.problem.keeping(clear)
        return Expansion.around(some, model.predict(some, self.free, self.poses[rows]), self.held)
