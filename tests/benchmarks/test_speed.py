"""How long an identification takes: as ratios within one run, and as exponents.

Times are of the processor, not of the wall, so that other work on the machine counts little.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import least_squares, root

from hexacell.campaign.online_estimate import OnlineEstimator
from hexacell.identification.estimator import estimate_online, identify
from hexacell.identification.problem.problem import Problem
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.study import data_sets
from hexacell.study.reference_solvers import error_vector
from tests.benchmarks.figures import at_least, at_most

SEARCH_SECONDS = 3.0
"""Longer than this nobody waits for the next pose."""

MOST_ITERATIONS = 100
STEP = np.array(1e-6)
"""Of finite differences, relative: the best for them. With scipy's own one of them does not converge."""

SIZES = (1_000, 3_000, 10_000, 30_000, 100_000)


def processor_seconds(work: Callable[[], object], repeats: int) -> float:
    """The quickest of some runs: what disturbs only ever adds."""
    taken = []
    for _ in range(repeats):
        begun = time.process_time()
        work()
        taken.append(time.process_time() - begun)
    return min(taken)


@pytest.fixture(scope="module")
def records_5x20(table_one) -> Problem:
    random = np.random.default_rng(20)
    campaign = data_sets.unlimited_travel(
        table_one.robot, table_one.truth, table_one.points, 20, np.radians(20), random
    )
    problem: Problem = table_one.robot.problem(campaign.measured(0.01, random))
    return problem


def test_against_the_pairwise_finite_difference_solve(records_5x20: Problem, figure) -> None:
    """Both from the drawing; theirs to scipy's own tolerances, without a search."""
    ours = processor_seconds(lambda: identify(records_5x20), 5)
    figure("5x20 records, identified in, outliers sought too", 1e3 * ours, "ms")
    for words, positions, least in (
        ("pairwise finite differences", one_by_one, 1000.0),
        ("the same with our batched kinematics", batched, 75.0),
    ):

        def errors(free: np.ndarray, positions=positions) -> np.ndarray:
            return error_vector(records_5x20, positions(records_5x20, free) - records_5x20.deviations)

        begun = time.process_time()
        found = least_squares(errors, records_5x20.prior.free, max_nfev=MOST_ITERATIONS, diff_step=STEP)
        seconds = time.process_time() - begun
        ended = "converged" if found.success else "given up"
        figure(f"  {words}: times as long", seconds / ours, "", at_least(least))
        figure(f"    iterations until it {ended}, {words}", found.njev)
        figure(f"    one of its iterations over all of ours, {words}", seconds / (found.njev or 1) / ours)


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


@pytest.fixture(scope="module")
def growth(table_one) -> dict[int, tuple[float, float]]:
    """Seconds and bytes by the number of records."""
    return {size: _measure(table_one, size) for size in SIZES}


def _measure(table_one, size: int) -> tuple[float, float]:
    problem = table_one.robot.problem(_many_records(table_one, size))
    seconds = processor_seconds(lambda: estimate_online(problem), 2)
    tracemalloc.start()
    estimate_online(problem)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return seconds, float(peak)


def _many_records(table_one, size: int) -> MeasurementSet:
    """A campaign of 20 poses at each point, visited again and again with new noise."""
    random = np.random.default_rng(size)
    campaign = data_sets.unlimited_travel(
        table_one.robot, table_one.truth, table_one.points, 20, np.radians(20), random
    )
    records: list[Record] = []
    for visit in range(size // len(campaign.joints)):
        records += [
            Record(r.point, r.orientation + 20 * visit, r.pose, r.joints, r.deviation)
            for r in campaign.measured(0.01, random).records
        ]
    return MeasurementSet(tuple(records))


@pytest.mark.parametrize(("what", "place"), [("time", 0), ("memory", 1)])
def test_cost_is_linear_in_the_records(growth, figure, what: str, place: int) -> None:
    sizes = np.log(list(growth))
    exponent = float(np.polyfit(sizes, np.log([cost[place] for cost in growth.values()]), 1)[0])
    largest = growth[SIZES[-1]][place]
    unit = "s" if what == "time" else "MiB"
    figure(f"100,000 records: {what}", largest / (1 if what == "time" else 2**20), unit)
    figure(f"  exponent of {what}", exponent, "", at_most(1.05))


@pytest.mark.parametrize(
    ("what", "change", "rows"),
    [
        ("one reading off by 1 mm", lambda d: np.add(d, [0.0, 0.0, 1.0]), slice(15, 16)),
        ("an early reading off by 1 mm", lambda d: np.add(d, [0.0, 0.0, 1.0]), slice(2, 3)),
        ("all gauges reversed", np.negative, slice(None)),
    ],
)
def test_the_search_for_false_readings_while_measuring_is_quick(
    table_one, figure, what, change, rows
) -> None:
    """All estimates of a campaign, as ``next`` computes them, beside those of true readings."""
    random = np.random.default_rng(11)
    measured = data_sets.unlimited_travel(
        table_one.robot, table_one.truth, table_one.points, 11, np.radians(20), random
    ).measured(0.01, random)
    records = list(measured.records)
    records[rows] = [replace(r, deviation=tuple(change(np.array(r.deviation)))) for r in records[rows]]
    true, false = (
        processor_seconds(partial(OnlineEstimator(table_one.robot).estimate, one), 1)
        for one in (measured, MeasurementSet(tuple(records)))
    )
    figure(f"{what}: search in", false - true, "s", at_most(SEARCH_SECONDS))
