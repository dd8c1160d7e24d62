"""Orientations that this program chooses where the paper drew them, by the drawing alone."""

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
from hexacell.study import data_sets

POOL_BATCHES = 10


def chosen_orientations(
    robot: Robot,
    truth: Geometry,
    points: Array,
    orientations: int,
    accurate_at: tuple[Array, float],
    amplitude: float,
    random: np.random.Generator,
) -> data_sets.DataSet:
    """So many orientations within ``amplitude``, rad, at each of some points (m, 3), mm, that we choose.

    It is to be accurate at points (k, 3), mm, within angles of so many rad (``accurate_at``).

    By the drawing alone, before anything is measured, for gauges of any travel: of a pool of random
    orientations at each point, one at a time, that which says most of the position at the poses where the
    robot is to be accurate (I-optimality, :mod:`hexacell.design.criteria`). The first is drawn. The
    ``truth`` decides what can be reached.

    Raises:
        LimitError: a point cannot be reached.
    """
    belief = robot.belief()
    pools = [_pool(robot, truth, point, amplitude, POOL_BATCHES, random) for point in points]
    records = [_records(belief, pool) for pool in pools]
    places, angle = accurate_at
    task = [_records(belief, _pool(robot, truth, place, angle, 1, random)) for place in places]
    squares = (np.einsum("nij,nik->jk", one.jacobian, one.jacobian) / len(one) for one in task)
    criterion = Criterion(sum(squares))
    taken, covariance = [[0] for _ in pools], belief.covariance
    for _ in range(orientations - 1):
        for rows, some in zip(taken, records, strict=True):
            gain = criterion.gain(covariance, some.jacobian, some.covariance)
            gain[rows] = -np.inf
            best = int(gain.argmax())
            rows.append(best)
            covariance = covariance_update(covariance, some.jacobian[best], some.covariance[best])
    return data_sets.data_set(
        robot, [pool[np.array(rows)] for pool, rows in zip(pools, taken, strict=True)], orientations
    )


def _pool(
    robot: Robot, truth: Geometry, point: Array, amplitude: float, batches: int, random: np.random.Generator
) -> data_sets.Reached:
    """What can be reached of some batches of random orientations at a point."""
    turns = islice(data_sets.random_orientations(random, amplitude), batches)
    drawn = (robot.frames.poses(PoseBatch.at(point, each)) for each in turns)
    return data_sets.Reached.joined([data_sets.reached(robot, truth, each) for each in drawn])


def _records(belief: RobotBelief, pool: data_sets.Reached) -> PredictedRecords:
    """The records of a pool, by the drawing, with the gauges zeroed at its first pose."""
    targets = ReachableTargets(pool.commands, pool.joints)
    first = pool[:1]
    zero = estimate_gauge_zero(belief, first.commands, first.joints, np.zeros((1, 3)))
    return predict_records(belief, zero, targets)
