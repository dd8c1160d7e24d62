"""Records of gauges that drift are weighted by exactly the covariance of a random walk."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.identification.problem.problem import Problem
from hexacell.identification.problem.random_walk import TRIAL, walk_columns
from hexacell.identification.solver.measurement_model import NuisanceElimination, Prediction, predict
from hexacell.measurements.records import MeasurementSet, Record

QUIET = Noise(0.002, 0.002)
STEP_MM = 0.0055
"""By it the reference moves by 20 um along each axis until the end of a set of 11 records."""

AGAIN = 1000


def closed(records: Sequence[Record]) -> tuple[Record, ...]:
    """The records of a point with its reference once more at the end."""
    return (*records, replace(records[0], orientation=AGAIN))


def linearized(problem: Problem, truth: Any) -> Prediction:
    free = problem.mechanism.convention.free_parameters(problem.mechanism.normalize_frames(truth)[0])
    return predict(problem, free, problem.solve_poses(free).poses)


def test_it_is_a_random_walk_that_begins_anew_at_each_point() -> None:
    columns = walk_columns(np.array([0, 3]), 5, 2.0).reshape(15, -1)
    steps = np.array([0, TRIAL, TRIAL + 1])
    walk = np.zeros((5, 5))
    walk[:3, :3] = np.minimum.outer(steps, steps)
    walk[4, 4] = TRIAL
    np.testing.assert_allclose(columns @ columns.T, 4.0 * np.kron(walk, np.eye(3)))


def test_the_cost_of_records_is_that_under_their_full_covariance(visit, make_problem, paper) -> None:
    noise = replace(QUIET, walk_mm=STEP_MM, gauge_scale=1e-3, alignment=2e-3)
    problem = make_problem(visit(points=3, orientations=4).measured(0.01), noise=noise)
    prediction = linearized(problem, paper.actual)
    n, shown = problem.records, problem.deviations
    columns = walk_columns(problem.first_rows, n, STEP_MM).reshape(3 * n, -1)
    covariance = columns @ columns.T
    for row, weight in enumerate(prediction.weights):
        covariance[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] += np.linalg.inv(weight)
    scale = 1e-3 * (shown[:, :, None] * np.eye(3)).reshape(3 * n, 3)
    turned = 2e-3 * np.swapaxes(np.cross(np.eye(3), shown[:, None]), -1, -2).reshape(3 * n, 3)
    same = np.kron(problem.stations[:, None] == problem.stations, np.ones((3, 3)))
    covariance += scale @ scale.T + same * (turned @ turned.T)
    at_points = np.kron(problem.stations[:, None] == np.arange(3), np.eye(3))
    weights, r = np.linalg.inv(covariance), prediction.residuals.ravel()
    weighted = weights @ at_points
    weights -= weighted @ np.linalg.solve(at_points.T @ weighted, weighted.T)
    cost = NuisanceElimination(problem, prediction.weights).cost(prediction.residuals)
    assert cost == pytest.approx(r @ weights @ r, rel=1e-6)


@pytest.mark.sample("3.0")
@pytest.mark.parametrize("ratio", [0.5, 3.0, 10.0])
def test_the_reference_once_more_gains_less_than_another_record(visit, make_problem, paper, ratio) -> None:
    """However fast it drifts over the noise: so a set has none in its middle, and is not longer."""
    noise, exact = replace(QUIET, walk_mm=ratio * QUIET.gauge_mm), visit(seed=2, orientations=13)
    task = linearized(make_problem(visit(seed=9).measured()), paper.actual).jacobian

    def error(readings: Callable[[list[Record]], list[Record]]) -> float:
        measured = exact.measured().records
        points = ([one for one in measured if one.point == point] for point in range(1, 6))
        records = tuple(one for point in points for one in closed(readings(point)))
        problem = make_problem(MeasurementSet(records), noise=noise)
        found = linearized(problem, paper.actual)
        system = NuisanceElimination(problem, found.weights).system(found.residuals, found.jacobian)
        covariance = np.linalg.inv(system.information() + problem.prior.precision)
        return float(np.sqrt(np.einsum("nap,pq,naq->", task, covariance, task)))

    def with_middle(point: list[Record]) -> list[Record]:
        return [*point[:6], replace(point[0], orientation=AGAIN + 1), *point[6:-1]]

    assert error(list) < error(with_middle)


def test_machines_whose_gauges_drift_are_identified_twice_as_well_and_within_u(visit, make_problem, paper):
    """Of 40 machines, whose sets move by 20 um: the error at poses of a task, and what is said of it."""
    exact = visit(seed=2).measured()
    points = [closed([one for one in exact.records if one.point == point]) for point in range(1, 6)]
    task = linearized(make_problem(visit(seed=9).measured()), paper.actual)

    def identified(seed: int, walk_mm: float) -> tuple[float, float]:
        """Mean square of the error, mm^2, and the error over its covariance for each parameter."""
        random, records = np.random.default_rng(seed), list[Record]()
        for point in points:
            steps = STEP_MM * np.sqrt([0, TRIAL, *[1] * (len(point) - 2)])
            drift = np.cumsum(steps[:, None] * random.standard_normal((len(point), 3)), axis=0)
            read = QUIET.gauge_mm * random.standard_normal((len(point), 9))
            for one, moved, noise in zip(point, drift, read, strict=True):
                deviation = np.add(one.deviation, noise[:3] + moved)
                joints = np.add(one.joints, noise[3:])
                if walk_mm or one.orientation != AGAIN:
                    records.append(
                        replace(one, deviation=tuple(deviation.tolist()), joints=tuple(joints.tolist()))
                    )
        problem = make_problem(MeasurementSet(tuple(records)), noise=replace(QUIET, walk_mm=walk_mm))
        found = identify(problem, find_outliers=False)
        error = found.free - task.free
        covered = error @ np.linalg.solve(found.free_covariance, error) / len(error)
        return float(np.mean(np.sum((task.jacobian @ error) ** 2, axis=1))), float(covered)

    without = np.mean([identified(seed, 0.0) for seed in range(40)], axis=0)
    drifting = np.mean([identified(seed, STEP_MM) for seed in range(40)], axis=0)
    assert np.sqrt(drifting[0]) < 0.6 * np.sqrt(without[0])
    assert 0.8 < drifting[1] < 1.25, "35 parameters of 40 machines are known to 4 %"
    assert without[1] > 5.0, "noise alone does not cover it"
