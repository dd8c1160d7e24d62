"""Robots drawn at random, and measurements that a known robot would give, exact or with noise.

Nothing here uses the derivatives that the estimator works with: poses are found by closing the legs, and
deviations are differences of positions.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.errors import LimitError
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Batch, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import has_singularity_margin
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot.model import Robot

BATCH = 64
BATCHES = 60
"""Orientations are drawn in batches, and so many batches at most."""


@dataclass(frozen=True, slots=True, eq=False)
class DataSet:
    """Poses at points, commanded and actual.

    Attributes:
        labels: point and orientation (n, 2).
        commands: poses in the controller's frames.
        joints: (n, 6), mm, exact.
        positions: actual positions of the ball (n, 3), mm, along the axes of the gauges.
    """

    labels: Array
    commands: PoseBatch
    joints: Array
    positions: Array

    def measured(self, noise_mm: float, random: np.random.Generator) -> MeasurementSet:
        """The records, with noise of ``noise_mm``, one standard deviation, on every number."""
        first = np.searchsorted(self.labels[:, 0], self.labels[:, 0])
        joints = self.joints + noise_mm * random.standard_normal(self.joints.shape)
        deviations = self.positions - self.positions[first]
        deviations = deviations + noise_mm * random.standard_normal(deviations.shape)
        rows = zip(self.labels.tolist(), joints.tolist(), deviations.tolist(), strict=True)
        return MeasurementSet(
            tuple(
                Record(int(point), int(orientation), self.commands.pose(row), tuple(q), tuple(d))
                for row, ((point, orientation), q, d) in enumerate(rows)
            )
        )


def unlimited_travel(
    robot: Robot,
    truth: Geometry,
    points: Array,
    orientations: int,
    amplitude: float,
    random: np.random.Generator,
) -> DataSet:
    """Random angles within ``amplitude``, rad, at points (m, 3), mm, as in the paper's simulation.

    Every pose is commanded at the point itself and may end far from it, so that gauges of any travel are
    assumed. Poses keep the robot's limits, its singularity margin among them; with a margin of 0 they only
    have to be reached without crossing a singularity.

    Raises:
        LimitError: too few of them can be.
    """
    sets = []
    for point in points:
        turns = random_orientations(random, amplitude)
        drawn = (robot.frames.poses(PoseBatch.at(point, each)) for each in turns)
        sets.append(first_reached(robot, truth, point, drawn, orientations))
    return data_set(robot, sets, orientations)


def random_orientations(random: np.random.Generator, amplitude: float) -> Iterator[Array]:
    """Batches of rotations (n, 3, 3) whose three angles are within ``amplitude``, rad."""
    for _ in range(BATCHES):
        yield rotations.from_angles(random.uniform(-amplitude, amplitude, (BATCH, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class Reached(Batch):
    """Commands (n), the joint variables (n, 6), mm, and the actual poses that they bring the robot to."""

    commands: PoseBatch
    joints: Array
    actual: PoseBatch


def first_reached(
    robot: Robot, truth: Geometry, point: Array, drawn: Iterable[PoseBatch], wanted: int
) -> Reached:
    """The first of some commands that the robot can be brought to without crossing a singularity.

    Raises:
        LimitError: there are fewer than wanted.
    """
    parts: list[Reached] = []
    for commands in drawn:
        parts.append(reached(robot, truth, commands))
        if sum(len(part.commands) for part in parts) >= wanted:
            return Reached.joined(parts)[:wanted]
    raise LimitError(f"too few poses can be reached at {point} without crossing a singularity")


def reached(robot: Robot, truth: Geometry, commands: PoseBatch) -> Reached:
    """The commands that keep the limits and, by both geometries, the singularity margin."""
    margin = robot.limits.singularity_margin
    actual = robot.commanded(truth).actual_poses(commands)
    rows = actual.found & robot.limits.allow_commands(commands) & robot.limits.allow_joints(actual.joints)
    rows[rows] = robot.limits.allow_legs(robot.mechanism, truth, actual.poses[rows], actual.joints[rows])
    found = Reached(commands, actual.joints, actual.poses)[rows]
    clear = [
        has_singularity_margin(robot.mechanism, geometry, poses, found.joints, margin)
        for geometry, poses in ((robot.commanding, found.commands), (truth, found.actual))
    ]
    return found[np.logical_and(*clear)]


def data_set(robot: Robot, sets: list[Reached], orientations: int) -> DataSet:
    """The data set of what was reached at each point, so many poses at each."""
    labels = [(point, turn) for point in range(1, len(sets) + 1) for turn in range(1, orientations + 1)]
    found = Reached.joined(sets)
    commands = robot.frames.inverse().poses(found.commands)
    return DataSet(np.array(labels), commands, found.joints, found.actual.positions @ robot.frames.base)
