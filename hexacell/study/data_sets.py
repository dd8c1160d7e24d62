"""Measurements that a known robot would give, noise not yet added.

Nothing here uses the derivatives that the estimator works with: poses are found by closing the
legs, and deviations are differences of positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.errors import LimitError
from hexacell.experiment_design.candidates import within_limits
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import CONTINUATION_STAGES
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot_model import Robot

BATCH = 64
ROUNDS = 60


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """Poses at points, as commanded and as really taken.

    Attributes:
        labels: point and orientation (n, 2).
        commands: as the controller was told, in its own geometry.
        joints: (n, 6), mm, exactly.
        positions: (n, 3), mm: where the ball really was.
    """

    labels: Array
    commands: PoseBatch
    joints: Array
    positions: Array

    def measured(self, noise_mm: float, random: np.random.Generator | None = None) -> MeasurementSet:
        """The records, every number disturbed by ``noise_mm``, one standard deviation."""
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
) -> Campaign:
    """Random angles within ``amplitude``, rad, at points (m, 3), mm, as in the paper's simulation.

    Every pose is commanded at the point itself and may end far from it; gauges with any travel are
    supposed. Poses keep the singularity ``margin``, by default the robot's limit; with 0 they only
    have to be reached without crossing a singularity.

    Raises:
        LimitError: too few of them can be.
    """
    sets = []
    for point in points:
        chosen = _Chosen(robot, truth, robot.limits.singularity_margin if margin is None else margin)
        for _ in range(ROUNDS):
            angles = random.uniform(-amplitude, amplitude, (BATCH, 3))
            chosen.offer(PoseBatch.at(point, rotations.from_angles(angles)), orientations)
            if chosen.count >= orientations:
                break
        else:
            raise _too_few(point)
        sets.append(chosen)
    return _campaign(sets, orientations)


def within_travel(
    robot: Robot,
    truth: Geometry,
    points: Array,
    orientations: int,
    amplitude: float,
    random: np.random.Generator,
) -> Campaign:
    """Random turns within ``amplitude``, rad, that keep the ball within the gauges' travel.

    They are aimed with the true geometry, which a program does not know: this is for studies of
    what can be identified from records that a machine with gauges can give at all.

    Raises:
        LimitError: a point, or enough poses at it, cannot be reached without crossing a singularity.
    """
    sets = []
    travel = 0.7 * robot.limits.gauge_travel_mm
    for point in points:
        chosen = _Chosen(robot, truth, robot.limits.singularity_margin)
        chosen.offer(PoseBatch.at(point, np.eye(3)[None]), 1)
        if chosen.count < 1:
            raise _too_few(point)
        reference = chosen.really[0]
        for _ in range(ROUNDS):
            turns = rotations.from_angles(random.uniform(-amplitude, amplitude, (BATCH, 3)))
            offsets = random.uniform(-travel, travel, (BATCH, 3))
            targets = PoseBatch(reference.positions + offsets, turns @ reference.rotations[0])
            chosen.offer(_commands(robot, truth, targets), orientations)
            if chosen.count >= orientations:
                break
        else:
            raise _too_few(point)
        sets.append(chosen)
    return _campaign(sets, orientations)


def _too_few(point: Array) -> LimitError:
    return LimitError(f"too few poses can be reached at {point} without crossing a singularity")


class _Chosen:
    """Poses at one point that the robot can be brought to without crossing a singularity."""

    def __init__(self, robot: Robot, truth: Geometry, margin: float) -> None:
        self._robot = robot
        self._margin = margin
        self._truth = truth
        self.commands: list[PoseBatch] = []
        self.joints: list[Array] = []
        self.really: list[PoseBatch] = []

    @property
    def count(self) -> int:
        return sum(len(poses) for poses in self.commands)

    def offer(self, commands: PoseBatch, wanted: int) -> None:
        robot = self._robot
        actual = robot.commanded(self._truth).actual_poses(commands)
        rows = np.flatnonzero(actual.found & within_limits(robot.limits, commands, actual.joints))
        commands, joints, really = commands[rows], actual.joints[rows], actual.poses[rows]
        margins = [
            singularity_margin(robot.mechanism, geometry, poses, joints)
            for geometry, poses in ((robot.commanding, commands), (self._truth, really))
        ]
        clear = np.min(margins, axis=0, initial=np.inf) >= self._margin
        kept = np.flatnonzero(clear)[: wanted - self.count]
        self.commands.append(commands[kept])
        self.joints.append(joints[kept])
        self.really.append(really[kept])


def _commands(robot: Robot, truth: Geometry, targets: PoseBatch) -> PoseBatch:
    """The commands that bring the true robot to those of the targets that it can be brought to."""
    joints = robot.mechanism.inverse(truth, robot.branch, targets)
    rows = np.flatnonzero(np.isfinite(joints).all(axis=-1))
    commands = robot.commanded(truth).commands_for(targets[rows], joints[rows], stages=CONTINUATION_STAGES)
    return commands.poses[np.flatnonzero(commands.found)]


def _campaign(sets: list[_Chosen], orientations: int) -> Campaign:
    labels = [(point, turn) for point in range(1, len(sets) + 1) for turn in range(1, orientations + 1)]
    commands = [poses for chosen in sets for poses in chosen.commands]
    return Campaign(
        np.array(labels),
        PoseBatch(
            np.concatenate([poses.positions for poses in commands]),
            np.concatenate([poses.rotations for poses in commands]),
        ),
        np.concatenate([joints for chosen in sets for joints in chosen.joints]),
        np.concatenate([poses.positions for chosen in sets for poses in chosen.really]),
    )
