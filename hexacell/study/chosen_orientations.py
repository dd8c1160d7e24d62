"""Orientations for the paper's experiment that this program chooses, as many as the paper takes at random.

By the drawing alone, before anything is measured, under the paper's assumption of gauges of any travel: of
a pool of random orientations at each point, one at a time, that which says most of the position at the
poses where the robot is to be accurate (I-optimality, :mod:`hexacell.design.criteria`).
"""

from __future__ import annotations

from itertools import islice

import numpy as np

from hexacell.design.candidates import ReachableTargets
from hexacell.design.criteria import Criterion, covariance_update
from hexacell.design.predicted_records import PredictedRecords, estimate_gauge_zero, predict_records
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot
from hexacell.study.data_sets import DataSet, Reached, data_set, random_orientations, reached

POOL_BATCHES = 10


def chosen_orientations(
    robot: Robot,
    truth: Geometry,
    points: Array,
    orientations: int,
    accurate_at: tuple[Array, float],
    amplitude: float,
    random: np.random.Generator,
) -> DataSet:
    """So many orientations within ``amplitude``, rad, at each of some points (m, 3), mm.

    Args:
        robot: with its drawing, its tolerances and the noise of its records.
        truth: the geometry that decides what can be reached.
        points: where the gauges are.
        orientations: at each point; the first is drawn.
        accurate_at: points (k, 3), mm, at which it is to be accurate, within angles of so many rad.
        amplitude: of each angle.
        random: source of the pools.

    Raises:
        LimitError: a point cannot be reached.
    """
    belief = robot.belief()
    pools = [_pool(robot, truth, point, amplitude, POOL_BATCHES, random) for point in points]
    records = [_records(belief, pool) for pool in pools]
    places, angle = accurate_at
    task = [_records(belief, _pool(robot, truth, place, angle, 1, random)) for place in places]
    criterion = Criterion(
        sum(np.einsum("nij,nik->jk", one.jacobian, one.jacobian) / len(one) for one in task)
    )
    taken, covariance = [[0] for _ in pools], belief.covariance
    for _ in range(orientations - 1):
        for rows, some in zip(taken, records, strict=True):
            gain = criterion.gain(covariance, some.jacobian, some.covariance)
            gain[rows] = -np.inf
            best = int(gain.argmax())
            rows.append(best)
            covariance = covariance_update(covariance, some.jacobian[best], some.covariance[best])
    return data_set(
        robot, [pool[np.array(rows)] for pool, rows in zip(pools, taken, strict=True)], orientations
    )


def _pool(
    robot: Robot, truth: Geometry, point: Array, amplitude: float, batches: int, random: np.random.Generator
) -> Reached:
    """What can be reached of some batches of random orientations at a point."""
    turns = islice(random_orientations(random, amplitude), batches)
    margin = robot.limits.singularity_margin
    return Reached.joined(
        [reached(robot, truth, robot.frames.poses(PoseBatch.at(point, each)), margin) for each in turns]
    )


def _records(belief: RobotBelief, pool: Reached) -> PredictedRecords:
    """The records of a pool, by the drawing, with the gauges zeroed at its first pose."""
    targets = ReachableTargets(pool.commands, pool.joints)
    first = pool[:1]
    zero = estimate_gauge_zero(belief, first.commands, first.joints, np.zeros((1, 3)))
    return predict_records(belief, zero, targets)
