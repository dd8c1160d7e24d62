"""The same records, identified by the paper's ordinary least squares and by ours.

Random angles within +-30 deg at P1 to P5, 11 at each, gauges of any travel: as the paper simulates.
Poses are kept if they can be reached without crossing a singularity, however near they come to one.
"""

from __future__ import annotations

import numpy as np

from hexacell.errors import ConvergenceError
from hexacell.identification.estimator import identify
from hexacell.study import data_sets
from hexacell.study.reference_solvers import gauss_newton
from tests.benchmarks.figures import at_most
from tests.benchmarks.samples import sample

SETS = sample(__name__, "SETS")


def test_error_is_at_least_halved(table_one, figure) -> None:
    robot, truth = table_one.robot, table_one.truth
    ours, paper, diverged = [], [], 0
    for seed in range(SETS):
        random = np.random.default_rng(seed)
        campaign = data_sets.unlimited_travel(
            robot, truth, table_one.points, 11, np.radians(30), random, margin=0.0
        )
        problem = robot.problem(campaign.measured(0.01, random))
        found = identify(problem)
        ours.append(found.geometry.largest_difference(truth))
        try:
            paper.append(gauss_newton(problem).largest_difference(truth))
        except ConvergenceError:
            # From the drawing it does not always arrive; its minimum is then looked for from ours.
            diverged += 1
            paper.append(gauss_newton(found.problem, start=found).largest_difference(truth))
    before, after = np.median(paper), np.median(ours)
    figure("largest parameter error, median: paper's least squares", before, "mm")
    figure("  ours on the same records", after, "mm")
    figure("  ours over the paper's", after / before, "", at_most(0.5))
    figure(f"  data sets of {SETS} on which eq. 13 diverges from the drawing", diverged)
