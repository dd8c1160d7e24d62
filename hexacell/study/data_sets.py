"""Robots drawn at random, and measurements that a known robot would give, exact or with noise.

Nothing here uses the derivatives that the estimator works with: poses are found by closing the legs, and
deviations are differences of positions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from hexacell.errors import LimitError
from hexacell.experiment_design.candidates import within_limits
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import CONTINUATION_STAGES
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot_model import Robot

BATCH = 64
BATCHES = 60

TRAVEL_SHARE = 0.7
"""Of the gauges' travel, for deviations aimed at."""


@dataclass(frozen=True, slots=True, eq=False)
class DataSet:
    """Poses at points, commanded and actual.

    Attributes:
        labels: point and orientation (n, 2).
        commands: poses in the controller's geometry.
        joints: (n, 6), mm, exact.
        positions: actual positions of the ball (n, 3), mm.
    """

    labels: Array
    commands: PoseBatch
    joints: Array
    positions: Array

    def measured(self, noise_mm: float, random: np.random.Generator | None = None) -> MeasurementSet:
        """The records, with noise of ``noise_mm``, one standard deviation, on every number."""
        random = random or np.random.default_rng()
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
    *,
    margin: float | None = None,
) -> DataSet:
    """Random angles within ``amplitude``, rad, at points (m, 3), mm, as in the paper's simulation.

    Every pose is commanded at the point itself and may end far from it, so that gauges of any travel are
    assumed. Poses keep the singularity ``margin``, by default the robot's limit; with 0 they only have
    to be reached without crossing a singularity.

    Raises:
        LimitError: too few of them can be.
    """
    margin = robot.limits.singularity_margin if margin is None else margin
    sets = []
    for point in points:
        poses = _PointPoses(robot, truth, point, margin)
        poses.fill(orientations, partial(_random_poses, point, random, amplitude))
        sets.append(poses)
    return _data_set(sets, orientations)


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
    travel = TRAVEL_SHARE * robot.limits.gauge_travel_mm
    sets = []
    for point in points:
        poses = _PointPoses(robot, truth, point, robot.limits.singularity_margin)
        poses.add(PoseBatch.at(point, np.eye(3)[None]), 1)
        if poses.count < 1:
            raise poses.too_few()
        reference = poses.actual[0]

        def commands(reference: PoseBatch = reference) -> PoseBatch:
            rotated = _random_orientations(random, amplitude) @ reference.rotations[0]
            offsets = random.uniform(-travel, travel, (BATCH, 3))
            return _commands(robot, truth, PoseBatch(reference.positions + offsets, rotated))

        poses.fill(orientations, commands)
        sets.append(poses)
    return _data_set(sets, orientations)


def _random_poses(point: Array, random: np.random.Generator, amplitude: float) -> PoseBatch:
    return PoseBatch.at(point, _random_orientations(random, amplitude))


def _random_orientations(random: np.random.Generator, amplitude: float) -> Array:
    return rotations.from_angles(random.uniform(-amplitude, amplitude, (BATCH, 3)))


class _PointPoses:
    """Poses at one point that the robot can be brought to without crossing a singularity."""

    def __init__(self, robot: Robot, truth: Geometry, point: Array, margin: float) -> None:
        self._robot = robot
        self._truth = truth
        self._point = point
        self._margin = margin
        self.commands: list[PoseBatch] = []
        self.joints: list[Array] = []
        self.actual: list[PoseBatch] = []

    @property
    def count(self) -> int:
        return sum(len(poses) for poses in self.commands)

    def fill(self, wanted: int, draw: Callable[[], PoseBatch]) -> None:
        """Add drawn commands until there are as many poses as wanted.

        Raises:
            LimitError: too few of them can be reached.
        """
        for _ in range(BATCHES):
            self.add(draw(), wanted)
            if self.count >= wanted:
                return
        raise self.too_few()

    def add(self, commands: PoseBatch, wanted: int) -> None:
        """Add those of some commands that can be reached, up to the number wanted."""
        robot = self._robot
        actual = robot.commanded(self._truth).actual_poses(commands)
        rows = np.flatnonzero(actual.found & within_limits(robot.limits, commands, actual.joints))
        commands, joints, poses = commands[rows], actual.joints[rows], actual.poses[rows]
        margins = [
            singularity_margin(robot.mechanism, geometry, some, joints)
            for geometry, some in ((robot.commanding, commands), (self._truth, poses))
        ]
        clear = np.min(margins, axis=0, initial=np.inf) >= self._margin
        kept = np.flatnonzero(clear)[: wanted - self.count]
        self.commands.append(commands[kept])
        self.joints.append(joints[kept])
        self.actual.append(poses[kept])

    def too_few(self) -> LimitError:
        return LimitError(f"too few poses can be reached at {self._point} without crossing a singularity")


def _commands(robot: Robot, truth: Geometry, targets: PoseBatch) -> PoseBatch:
    """The commands that bring the true robot to those of the targets that it can be brought to."""
    joints = robot.mechanism.inverse(truth, robot.branch, targets)
    rows = np.flatnonzero(np.isfinite(joints).all(axis=-1))
    commands = robot.commanded(truth).commands_for(targets[rows], joints[rows], stages=CONTINUATION_STAGES)
    return commands.poses[np.flatnonzero(commands.found)]


def _data_set(sets: list[_PointPoses], orientations: int) -> DataSet:
    labels = [(point, turn) for point in range(1, len(sets) + 1) for turn in range(1, orientations + 1)]
    return DataSet(
        np.array(labels),
        PoseBatch.concatenate(poses for one in sets for poses in one.commands),
        np.concatenate([joints for one in sets for joints in one.joints]),
        np.concatenate([poses.positions for one in sets for poses in one.actual]),
    )


def random_robot(
    mechanism: Mechanism, drawing: Geometry, error_mm: float, random: np.random.Generator
) -> Geometry:
    """A geometry in the frame convention, each free parameter uniform within ``error_mm``.

    As in Table 1 of Abtahi et al. 2010 (section 3.1, +-7 mm).
    """
    free = mechanism.convention.free_parameters(drawing)
    return mechanism.convention.geometry(free + random.uniform(-error_mm, error_mm, len(free)))
