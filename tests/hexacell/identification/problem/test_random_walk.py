"""Records of gauges that drift are weighted by exactly the covariance of a random walk."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.identification.problem.problem import Problem
from hexacell.identification.problem.random_walk import TRIAL, GaugeWalk, walk_columns
from hexacell.identification.solver.measurement_model import NuisanceElimination, Prediction, predict
from hexacell.measurements.records import MeasurementSet, Record
from tests.hexacell.altered_records import altered

QUIET = Noise(0.002, 0.002)
STEP_MM = 0.0055
"""By it the reference moves by 20 um along each axis until the end of a set of 11 records."""

AGAIN = 1000


def closed(
    measured: MeasurementSet, change: Callable[[list[Record]], list[Record]] = list
) -> MeasurementSet:
    """Records, those of a point with a change, and its reference once more at the end."""
    points = [[one for one in measured.records if one.point == point] for point in measured.counts]
    ends = [replace(records[0], orientation=AGAIN) for records in points]
    return MeasurementSet(
        tuple(one for r, end in zip(points, ends, strict=True) for one in (*change(r), end))
    )


def linearized(problem: Problem, truth: Any) -> Prediction:
    free = problem.mechanism.convention.free_parameters(problem.mechanism.normalize_frames(truth)[0])
    return predict(problem, free, problem.solve_poses(free).poses)


def test_it_begins_anew_at_each_point() -> None:
    columns = walk_columns(np.array([0, 3]), 6, GaugeWalk(2.0)).reshape(18, -1)
    steps = [0, TRIAL, TRIAL + 1]
    walk = np.kron(np.eye(2), np.minimum.outer(steps, steps))
    np.testing.assert_allclose(columns @ columns.T, 4.0 * np.kron(walk, np.eye(3)))
    assert walk_columns(np.arange(3), 3, GaugeWalk(2.0)).shape == (3, 3, 0)


def test_it_goes_by_time_where_that_is_known_of_all_records() -> None:
    first_rows, times = np.array([0, 3]), np.array([5.0, 6.0, 66.0, 900.0, 900.5, 903.0])
    walk = GaugeWalk(2.0, 0.5)
    columns = walk_columns(first_rows, 6, walk, 0.5 * times).reshape(18, -1)
    apart = [np.minimum.outer(elapsed, elapsed) for elapsed in ([0.0, 1.0, 61.0], [0.0, 0.5, 3.0])]
    np.testing.assert_allclose(columns @ columns.T, 4.0 * np.kron(block_diag(*apart), np.eye(3)))
    counted = walk_columns(first_rows, 6, GaugeWalk(2.0))
    np.testing.assert_array_equal(walk_columns(first_rows, 6, walk, np.append(times[:5], np.nan)), counted)
    np.testing.assert_array_equal(walk_columns(first_rows, 6, GaugeWalk(2.0), times), counted)


def test_by_time_a_walk_with_a_pause_is_estimated_better_than_by_count(visit, make_problem, paper) -> None:
    """An hour's pause in each set of a minute a record: 400 walks are drawn for a linearized machine."""
    exact = closed(visit(seed=2).measured())
    minutes, random, step_mm = np.arange(12.0) + 60.0 * (np.arange(12) > 6), np.random.default_rng(7), 0.003
    read_s = iter(np.tile(60.0 * minutes, 5).tolist())
    timed = altered(exact, lambda _: {"time_s": next(read_s)})
    steps = step_mm * np.sqrt(np.diff(minutes, prepend=0.0))[:, None, None]
    walks = np.cumsum(steps * random.standard_normal((5, 12, 3, 400)), axis=1).reshape(60, 3, 400)
    task = linearized(make_problem(visit(seed=9).measured()), paper.actual).jacobian

    def estimated(walk: GaugeWalk) -> tuple[float, float]:
        problem = make_problem(timed, noise=replace(QUIET, walk=walk))
        found, scatter = linearized(problem, paper.actual), random.standard_normal((60, 3, 400))
        noise = np.linalg.solve(np.swapaxes(np.linalg.cholesky(found.weights), 1, 2), scatter)
        both = np.concatenate([found.jacobian, walks + noise], axis=-1)
        rows = NuisanceElimination(problem, found.weights).system(found.residuals, both).rows
        by_free, by_draws = np.split(rows, [found.jacobian.shape[-1]], axis=1)
        error = np.linalg.lstsq(by_free, by_draws, rcond=None)[0]
        covered = np.sum((by_free @ error) ** 2, axis=0) / len(error)
        return float(np.sqrt(np.mean((task @ error) ** 2))), float(np.mean(covered))

    by_time = estimated(GaugeWalk(step_mm, 60.0))
    counted = estimated(GaugeWalk(step_mm * np.sqrt(71.0 / 14.0)))
    assert by_time[0] < 0.8 * counted[0]
    assert by_time[1] == pytest.approx(1.0, abs=0.05) != counted[1]


@pytest.mark.sample("3.0")
@pytest.mark.parametrize("ratio", [0.5, 3.0, 10.0])
def test_the_reference_once_more_gains_less_than_another_record(visit, make_problem, paper, ratio) -> None:
    """However fast it drifts over the noise: so a set has none in its middle, and is not longer."""
    noise = replace(QUIET, walk=GaugeWalk(ratio * QUIET.gauge_mm))
    measured = visit(seed=2, orientations=13).measured()
    task = linearized(make_problem(visit(seed=9).measured()), paper.actual).jacobian

    def error(change: Callable[[list[Record]], list[Record]]) -> float:
        problem = make_problem(closed(measured, change), noise=noise)
        found = linearized(problem, paper.actual)
        system = NuisanceElimination(problem, found.weights).system(found.residuals, found.jacobian)
        covariance = np.linalg.inv(system.information() + problem.prior.precision)
        return float(np.sqrt(np.einsum("nap,pq,naq->", task, covariance, task)))

    assert error(list) < error(lambda r: [*r[:6], replace(r[0], orientation=AGAIN + 1), *r[6:-1]])


@pytest.mark.slow
def test_machines_whose_gauges_drift_are_identified_twice_as_well_and_within_u(visit, make_problem, paper):
    """Of 40 machines, whose sets move by 20 um: the error at poses of a task, and what is said of it."""
    exact = closed(visit(seed=2).measured())
    task = linearized(make_problem(visit(seed=9).measured()), paper.actual)
    steps = STEP_MM * np.sqrt([0, TRIAL, *[1] * 10])[:, None]

    def identified(seed: int, walk_mm: float) -> tuple[float, float]:
        """Mean square of the error, mm^2, and the error over its covariance for each parameter."""
        random = np.random.default_rng(seed)
        walks = (np.cumsum(steps * random.standard_normal((12, 3)), axis=0) for _ in range(5))
        drift = iter(np.concatenate([*walks]) + QUIET.gauge_mm * random.standard_normal((60, 3)))
        read = iter(QUIET.encoder * random.standard_normal((60, 6)))
        shown = altered(
            exact, lambda r: {"deviation": r.deviation + next(drift), "joints": r.joints + next(read)}
        )
        if not walk_mm:
            shown = MeasurementSet(tuple(one for one in shown.records if one.orientation != AGAIN))
        noise = replace(QUIET, walk=GaugeWalk(walk_mm))
        found = identify(make_problem(shown, noise=noise), find_outliers=False)
        error = found.free - task.free
        covered = error @ np.linalg.solve(found.free_covariance, error) / len(error)
        return float(np.mean(np.sum((task.jacobian @ error) ** 2, axis=1))), float(covered)

    without, drifting = (
        np.mean([identified(seed, walk) for seed in range(40)], axis=0) for walk in (0, STEP_MM)
    )
    assert np.sqrt(drifting[0]) < 0.6 * np.sqrt(without[0])
    assert 0.8 < drifting[1] < 1.25, "35 parameters of 40 machines are known to 4 %"
    assert without[1] > 5.0, "noise alone does not cover it"
