"""How long an identification takes, and how many times as long the paper's way takes.

Times are of the processor, not of the wall, so that other work on the machine counts little.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import least_squares, root

from hexacell.campaign.online_estimate import OnlineEstimator
from hexacell.identification.estimator import identify
from hexacell.identification.problem.problem import Problem
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.measurements.records import MeasurementSet
from hexacell.study import data_sets
from hexacell.study.reference_solvers import error_vector
from tests.benchmarks.figures import at_least
from tests.benchmarks.machines import at_most_here

SEARCH_SECONDS = 3.0
"""Longer than this nobody waits for the next pose."""

MOST_ITERATIONS = 100
STEP = np.array(1e-6)
"""Of finite differences, relative: the best for them. With scipy's own one of them does not converge."""


def processor_seconds(work: Callable[[], object], repeats: int) -> float:
    """The quickest of some runs: what disturbs only ever adds."""
    taken = []
    for _ in range(repeats):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return min(taken)


def measured(table_one, orientations: int) -> MeasurementSet:
    """Records within +-20 deg at the paper's points."""
    random = np.random.default_rng(orientations)
    robot, truth, points = table_one.robot, table_one.truth, table_one.points
    campaign = data_sets.unlimited_travel(robot, truth, points, orientations, np.radians(20), random)
    return campaign.measured(0.01, random)


def test_against_the_pairwise_finite_difference_solve(table_one, figure) -> None:
    """Both from the drawing; theirs to scipy's own tolerances, without a search."""
    # Gauges that reach as far as these deviations, or another unit would be looked for as well.
    problem: Problem = replace(table_one.robot.problem(measured(table_one, 20)), travel_mm=(200.0,) * 3)
    ours = processor_seconds(lambda: identify(problem), 5)
    figure("5x20 records, identified in, outliers sought too", 1e3 * ours, "ms")
    for words, positions, least in (
        ("pairwise finite differences", one_by_one, 1000.0),
        ("the same with our batched kinematics", batched, 75.0),
    ):

        def errors(free: np.ndarray, positions=positions) -> np.ndarray:
            return error_vector(problem, positions(problem, free) - problem.deviations)

        begun = time.process_time()
        found = least_squares(errors, problem.prior.free, max_nfev=MOST_ITERATIONS, diff_step=STEP)
        seconds = time.process_time() - begun
        figure(f"  {words}: times as long", seconds / ours, "", at_least(least))
        # A reference that did not converge is none.
        figure(f"    {words}: converged", int(found.success), f"after {found.njev} iterations", at_least(1))


def one_by_one(problem: Problem, free: np.ndarray) -> np.ndarray:
    """Eq. 4, written down: each record's pose solved for, by scipy and finite differences."""
    geometry = Geometry(HEXAGLIDE_PARAMETERS, problem.basis @ free)

    def position(row: int) -> np.ndarray:
        def legs(pose: np.ndarray) -> np.ndarray:
            v = geometry["S"] - pose[:3] - geometry["B"] @ rotations.from_angles(pose[3:]).T
            v[:, 0] += problem.joints[row]
            return np.asarray(np.sum(v * v, axis=1) - geometry["l"] ** 2)

        angles = rotations.to_angles(problem.start.rotations[row])
        return root(legs, np.concatenate([problem.start.positions[row], angles])).x[:3]

    return np.array([position(row) for row in range(problem.records)])


def batched(problem: Problem, free: np.ndarray) -> np.ndarray:
    return np.asarray(problem.solve_poses(free).poses.positions)


FALSE_READINGS: dict[str, tuple[Callable[[np.ndarray], np.ndarray], slice]] = {
    "one reading off by 1 mm": (lambda d: np.add(d, [0.0, 0.0, 1.0]), slice(15, 16)),
    "an early reading off by 1 mm": (lambda d: np.add(d, [0.0, 0.0, 1.0]), slice(2, 3)),
    "all gauges reversed": (np.negative, slice(None)),
}


@pytest.mark.parametrize("what", FALSE_READINGS)
def test_the_search_for_false_readings_while_measuring_is_quick(table_one, figure, what: str) -> None:
    """All estimates of a campaign, as ``next`` computes them, beside those of true readings."""
    change, rows = FALSE_READINGS[what]
    right = measured(table_one, 11)
    records = list(right.records)
    records[rows] = [replace(r, deviation=tuple(change(np.array(r.deviation)))) for r in records[rows]]
    true, false = (
        processor_seconds(partial(OnlineEstimator(table_one.robot).estimate, one), 1)
        for one in (right, MeasurementSet(tuple(records)))
    )
    figure(f"{what}: search in", false - true, "s", at_most_here(SEARCH_SECONDS))
