"""A world: one imperfect machine with its gauges, and everything that it would show or do.

The controller computes with the product's geometry. The machine is closed by other equations
(:mod:`~tests.benchmarks.worlds.closure`), with whatever is off in it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record, deviation_of, joints_of
from hexacell.robot.model import Robot
from tests.benchmarks.worlds import frames
from tests.benchmarks.worlds.closure import STAGES, Bodies, CannotCloseError, close, follow, slider_places
from tests.benchmarks.worlds.effects import Effect, Posture, Stops

SWEEPS, MOST_SWEEPS = 4, 60
"""Displacements by the pose, and the pose by them, in turn, at least and at most."""

BALANCED_MM = 1e-4
"""By how much legs are longer or shorter than their forces have them, in the end."""

ON_THE_WAY, STAGES_ON_THE_WAY = 8, 4
"""Places between two stops at which the machine is in balance, and stages from one to the next."""

STAGES_PER_MM = 4.0
DRAWS = 32
"""Visits of a pose over which its expected error is taken, if the machine does not repeat."""


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """Commands in the convention's frames, and point and orientation (n, 2) of each, counted from 1.

    ``sides`` (n, 6): see :class:`~tests.benchmarks.worlds.effects.Stops`.
    """

    poses: PoseBatch
    labels: NDArray[np.int_]
    sides: Array | None = None

    @property
    def points(self) -> NDArray[np.intp]:
        """The point of each, counted from 0."""
        return self.labels[:, 0].astype(np.intp) - 1


@dataclass(frozen=True, slots=True, eq=False)
class TaskErrors:
    """What the machine does at n task poses, in the frames that fit the workspace best.

    Attributes:
        vectors: expected errors of the position (n, 3), mm.
        scatter: root mean square distance (n,) of single visits from there, mm.
        once: errors (n, 3) of one visit, mm.
    """

    vectors: Array
    scatter: Array
    once: Array

    @property
    def largest_mm(self) -> float:
        """At the worst task pose."""
        return float(np.linalg.norm(self.vectors, axis=-1).max())

    @property
    def largest_once_mm(self) -> float:
        """The largest of one visit of each."""
        return float(np.linalg.norm(self.once, axis=-1).max())


@dataclass(frozen=True, eq=False)
class World:
    """An imperfect machine.

    Attributes:
        robot: what the program knows of it.
        truth: the geometry that it would have without its effects, in the convention's frames.
        seed: of all that is random.
        is_noisy: whether readings have the stated noise.
        sent_further: what the controller adds to its joints (n, 6), mm, at some poses, for joints that come
            from some directions.
    """

    robot: Robot
    truth: Geometry
    effect: Effect
    seed: int
    is_noisy: bool = True
    sent_further: Callable[[PoseBatch, Array, Array], Array] | None = None

    def records(self, commands: Commands, commanding: Geometry, start: float = 0.0) -> MeasurementSet:
        """The records of commands through a geometry; ``start`` is the hour of the first one.

        Raises:
            CannotCloseError: a command leads through a singularity.
        """
        stops = self._corrected(self._stops(commands, commanding, start), commands.poses)
        stopped, poses = self._reached(stops, commanding, commands.poses)
        touched = poses.positions + self.effect.ball(stops, poses.rotations)
        random = np.random.default_rng([self.seed, 1, int(1e3 * start)])
        noise = self.robot.noise
        shown = self._gauges(stops, touched)
        joints = stopped + self.effect.encoder_noise(stops)
        if self.is_noisy:
            shown = shown + noise.gauge_mm * random.standard_normal(shown.shape)
            joints = joints + noise.encoder * random.standard_normal(joints.shape)
        deviations = shown - shown[_firsts(stops.points)]
        return MeasurementSet(
            tuple(
                Record(
                    int(commands.labels[row, 0]),
                    int(commands.labels[row, 1]),
                    self.robot.to_command(commands.poses.pose(row)),
                    joints_of(joints[row]),
                    deviation_of(deviations[row]),
                    tuple(stops.directions[row].astype(int).tolist()),
                )
                for row in range(len(stops))
            )
        )

    def hours(self, commands: Commands, commanding: Geometry, start: float = 0.0) -> float:
        """The hour at which the last of some commands is measured."""
        return float(self._stops(commands, commanding, start).hours[-1])

    def reached(self, poses: PoseBatch, commanding: Geometry, start: float = 0.0) -> PoseBatch:
        """Where the machine goes for commands through a geometry."""
        stops = self._corrected(self._stops(_one_point(poses), commanding, start), poses)
        return self._reached(stops, commanding, poses)[1]

    def errors(
        self, written: Geometry, task: PoseBatch, workspace: PoseBatch, hour: float = 0.0
    ) -> TaskErrors:
        """The errors at task poses that are commanded through a ``written`` geometry at some hour."""
        wanted = PoseBatch.joined([task, workspace])
        drawn = self._visits(wanted, written, hour, DRAWS if self.effect.is_random else 1)
        mean = _mean(drawn)
        length = float(np.linalg.norm(self.truth["B"], axis=-1).mean())
        count = len(task)
        best = frames.best_frames(mean[count:], workspace, length)
        there, once = (frames.moved(one[:count], best).positions for one in (mean, drawn[0]))
        scatter = np.mean(
            [np.sum((one.positions[:count] - mean.positions[:count]) ** 2, axis=-1) for one in drawn],
            axis=0,
        )
        return TaskErrors(there - task.positions, np.sqrt(scatter), once - task.positions)

    def _visits(self, poses: PoseBatch, written: Geometry, hour: float, visits: int) -> list[PoseBatch]:
        """Where the machine goes on some visits of all poses, each from another one, all at one hour."""
        every = PoseBatch.joined([poses] * visits)
        stops = self._stops(_one_point(every), written, hour)
        order = np.random.default_rng([self.seed, 2]).permutation(len(every))
        stops = replace(
            stops, hours=np.full(len(every), hour), previous=order, seed=(self.seed, 3), at_work=True
        )
        reached = self._reached(self._corrected(stops, every), written, every)[1]
        return [reached[slice(first, first + len(poses))] for first in range(0, len(every), len(poses))]

    def _stops(self, commands: Commands, commanding: Geometry, start: float) -> Stops:
        joints = slider_places(commanding, self.robot.branch, commands.poses)
        stops = Stops.of(commands.points, joints, start, (self.seed, 0, int(1e3 * start)))
        return replace(stops, sides=commands.sides)

    def _corrected(self, stops: Stops, poses: PoseBatch) -> Stops:
        """The stops of a controller that corrects what is not geometry."""
        if self.sent_further is None:
            return stops
        further = self.sent_further(poses, stops.joints, stops.directions)
        return replace(stops, joints=stops.joints + further)

    def _reached(self, stops: Stops, commanding: Geometry, commands: PoseBatch) -> tuple[Array, PoseBatch]:
        """What the encoders show (n, 6), mm, and the poses of the platform."""
        perfect, ideal = Bodies.of(commanding, stops.joints), Bodies.of(self.truth, stops.joints)
        stages = _stages(commanding, self.truth)
        poses = follow(perfect, ideal, commands, stages)
        shown = stops.joints + self.effect.following_error(stops)
        really = shown - self.effect.encoder_error(stops, shown)
        drawn = Bodies.of(self.truth, really)
        if self.effect.has_memory:
            return shown, self._arrived(stops, drawn, poses)
        return shown, self._balanced(stops, drawn, drawn, poses)[1]

    def _arrived(self, stops: Stops, drawn: Bodies, poses: PoseBatch) -> PoseBatch:
        """The poses of a machine that comes from other stops, and meanwhile keeps its balance.

        Where no straight way leads from one to the other, as if it were put there.
        """
        bodies, balanced = self._balanced(stops, drawn, drawn, poses)
        came, every = stops.previous, np.arange(len(stops))
        try:
            return self._on_the_way(stops, (drawn[came], drawn), bodies[came], balanced[came])
        except CannotCloseError:
            pass
        for row in every[:, None]:
            try:
                left = drawn[came[row]], drawn[row]
                there = self._on_the_way(stops[row], left, bodies[came[row]], balanced[came[row]])
            except CannotCloseError:
                continue
            balanced = balanced.with_rows(row, there)
        return balanced

    def _on_the_way(
        self, stops: Stops, way: tuple[Bodies, Bodies], bodies: Bodies, poses: PoseBatch
    ) -> PoseBatch:
        here, (left, end) = way[0], way
        for stage in range(1, ON_THE_WAY + 1):
            there = left.blend(end, stage / ON_THE_WAY)
            moved = bodies.moved_with(here, there)
            poses = follow(bodies, moved, poses, STAGES_ON_THE_WAY)
            bodies, poses = self._balanced(stops, there, moved, poses, least=1)
            here = there
        return poses

    def _balanced(
        self, stops: Stops, drawn: Bodies, bodies: Bodies, poses: PoseBatch, least: int = SWEEPS
    ) -> tuple[Bodies, PoseBatch]:
        """Where displacements and forces agree, from ``bodies`` in their ``poses``, which are shifted.

        ``drawn`` are the bodies without the effect. A leg with play that is pulled when it is short and
        pushed when it is long swings about the place between, where nothing pulls it.
        """
        share, before = np.ones_like(drawn.lengths), np.zeros_like(drawn.lengths)
        joints = drawn.sliders[..., 0] - self.truth["S"][:, 0]
        for sweep in range(1, MOST_SWEEPS + 1):
            shift = self.effect.shift(stops, Posture(joints, bodies, poses))
            missing = drawn.lengths + shift.lengths - bodies.lengths
            if sweep > least and np.abs(missing).max() < BALANCED_MM:
                break
            share, before = np.where(missing * before < 0.0, 0.5 * share, share), missing
            changed = Bodies(
                drawn.sliders + shift.sliders,
                drawn.platform + shift.platform,
                bodies.lengths + share * missing,
            )
            poses, bodies = _settled(bodies, changed, poses), changed
        return bodies, poses

    def _gauges(self, stops: Stops, touched: Array) -> Array:
        """What the gauges show (n, 3), mm, along the axes of the controller's base."""
        moved = (touched - touched[_firsts(stops.points)]) @ self.robot.frames.base
        shown: Array = moved + self.effect.gauge_error(stops, moved)
        return shown


def _stages(commanding: Geometry, truth: Geometry) -> int:
    """In how many stages a pose is followed from one geometry to another."""
    return int(np.clip(STAGES_PER_MM * commanding.largest_difference(truth), 2, STAGES))


def _settled(bodies: Bodies, changed: Bodies, poses: PoseBatch) -> PoseBatch:
    """The poses after a change of the bodies, in small stages if it is large."""
    try:
        return close(changed, poses)
    except CannotCloseError:
        return follow(bodies, changed, poses, STAGES)


def _firsts(points: NDArray[np.intp]) -> NDArray[np.intp]:
    """The row (n,) of the first stop at the point of each."""
    listed: Sequence[int] = points.tolist()
    return np.array([listed.index(point) for point in listed])


def _one_point(poses: PoseBatch) -> Commands:
    labels = np.stack([np.ones(len(poses), dtype=np.int_), np.arange(1, len(poses) + 1)], axis=-1)
    return Commands(poses, labels)


def _mean(drawn: Sequence[PoseBatch]) -> PoseBatch:
    """The mean of poses that are near each other."""
    positions = np.mean([poses.positions for poses in drawn], axis=0)
    first = drawn[0].rotations
    turns = [
        Rotation.from_matrix(poses.rotations @ np.swapaxes(first, -1, -2)).as_rotvec() for poses in drawn
    ]
    return PoseBatch(positions, Rotation.from_rotvec(np.mean(turns, axis=0)).as_matrix() @ first)
