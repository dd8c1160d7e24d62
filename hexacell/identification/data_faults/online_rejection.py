"""Gross errors while measuring: left out one after another, each with an estimate that continues the last.

It needs no fit from the drawing and asks for no cause: what is false, and why, is found from all records by
:mod:`.rejection`. Records are left out only while the others have equations to spare; fewer agree with
anything, and prove nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hexacell.identification.data_faults.hypothesis_search import LARGEST_REJECTED_SHARE
from hexacell.identification.data_faults.score_tests import OutlierStatistics
from hexacell.identification.problem.data_requirements import is_overdetermined
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.levenberg_marquardt import INCREMENTAL
from hexacell.identification.solver.linearized_model import LinearizedModel
from hexacell.identification.solver.result import Identification
from hexacell.identification.solver.singular_records import solve_around_singularities
from hexacell.kinematics.rotations import Mask


def without_gross_errors(found: Identification) -> Iterator[Identification]:
    """Estimates without the most significant gross error, without two, and so on."""
    largest = LARGEST_REJECTED_SHARE * found.records
    rejected = 0
    while rejected < largest:
        statistics = OutlierStatistics.of(LinearizedModel.at_solution(found))
        ratio = statistics.threshold_ratio(rejected)
        kept = np.arange(found.records) != int(np.argmax(ratio))
        if ratio.max() <= 1.0 or not is_overdetermined(found.problem.subset(kept)):
            return
        found, rejected = _without(found, kept), rejected + 1
        yield found


def _without(found: Identification, kept: Mask) -> Identification:
    """The estimate from some of the records (n,), with the prior that it had."""
    some: Problem = found.problem.starting_at(
        found.free, found.poses, np.ones(found.records, dtype=bool)
    ).subset(kept)
    problem, solution = solve_around_singularities(some, found.active_prior, INCREMENTAL)
    return Identification(problem, solution, found.active_prior)
