"""Measurements that a robot with gauges could give, aimed with its true geometry."""

from collections.abc import Iterator

import numpy as np

from hexacell.kinematics.forward import CONTINUATION_STAGES
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot
from hexacell.study.data_sets import BATCH, DataSet, Reached, data_set, first_reached, random_orientations

TRAVEL_SHARE = 0.7
"""Share of the gauges' travel within which deviations are aimed."""


def within_travel(
    robot: Robot,
    truth: Geometry,
    points: Array,
    orientations: int,
    amplitude: float,
    random: np.random.Generator,
) -> DataSet:
    """Random rotations within ``amplitude``, rad, that keep the ball within the gauges' travel.

    They are aimed with the true geometry, which a program does not know. They show what can be identified
    from records that a robot with gauges can give at all.

    Raises:
        LimitError: a point, or enough poses at it, cannot be reached without crossing a singularity.
    """
    sets = []
    for point in points:
        level = [robot.frames.poses(PoseBatch.at(point, np.eye(3)[None]))]
        reference = first_reached(robot, truth, point, level, 1)
        drawn = _aimed(robot, truth, reference.actual, amplitude, random)
        others = first_reached(robot, truth, point, drawn, orientations - 1)
        sets.append(Reached.joined([reference, others]))
    return data_set(robot, sets, orientations)


def _aimed(
    robot: Robot, truth: Geometry, reference: PoseBatch, amplitude: float, random: np.random.Generator
) -> Iterator[PoseBatch]:
    """Commands that bring the true robot to rotations from the reference, inside the travel."""
    travel = TRAVEL_SHARE * robot.limits.gauge_travel_mm
    for turns in random_orientations(random, amplitude):
        positions = reference.positions + random.uniform(-travel, travel, (BATCH, 3))
        targets = PoseBatch(positions, turns @ reference.rotations[0])
        joints = robot.mechanism.inverse(truth, robot.branch, targets)
        rows = np.flatnonzero(np.isfinite(joints).all(axis=-1))
        commanded = robot.commanded(truth)
        commands = commanded.commands_for(targets[rows], joints[rows], stages=CONTINUATION_STAGES)
        yield commands.poses[commands.found]
