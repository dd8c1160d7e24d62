"""Virtual robots: geometries drawn within the tolerances, moved by the real controller's geometry."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from hexacell.errors import LimitError, ReachError
from hexacell.identification.problem.prior import Tolerances
from hexacell.kinematics.commanded_motion import ActualPoses
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism, inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.measurements.records import Directions, Record, deviation_of, joints_of
from hexacell.motion.arrival import UNKNOWN, arrival_directions, least_way
from hexacell.motion.trajectory import interpolate_line, trace_path
from hexacell.robot.model import Robot

PIECES = 24
"""Pieces that a line is divided into."""

LEAST_MARGIN_SHARE = 0.5
"""Share of the singularity margin that poses keep; the actual robot may have less than estimated."""

AS_DRAWN_MM = 1e-3
"""A controller whose parameters differ less from the drawing has the drawing's geometry."""

WEAR_SHARE = 0.1
"""Share of the tolerances by which a robot may have drifted since it was calibrated."""


@dataclass(eq=False)
class VirtualRobot:
    """Goes where it is commanded in its controller's frames, on its own geometry, and answers with records.

    Attributes:
        model: what is known of it: mechanism, commanding geometry, noise and limits.
        truth: its geometry, in the mechanism's frame convention.
        stops: one standard deviation of where a joint stops beside its command, as its encoder shows it, in
            its unit; None for what the model's noise states.
        unseen: likewise beside what its encoder shows.
    """

    model: Robot
    truth: Geometry
    random: np.random.Generator = field(default_factory=np.random.default_rng)
    stops: float | None = None
    unseen: float = 0.0
    _command: Pose | None = None
    _actual: PoseBatch | None = None
    _shown: Array = field(default_factory=lambda: np.full((1, 6), np.nan))
    _joints_commanded: Array | None = None
    _directions: Directions = UNKNOWN
    _zero: Array | None = None

    def actual_poses(self, commands: PoseBatch) -> ActualPoses:
        """Where it would go for n commands in the convention's frames; itself it does not move."""
        return self.model.commanded(self.truth).actual_poses(commands)

    def margins(self, commands: PoseBatch) -> Array:
        """Its singularity margins (n,) at n commands; 0 where it cannot go."""
        actual, margins = self.actual_poses(commands), np.zeros(len(commands))
        poses, joints = actual.poses[actual.found], actual.joints[actual.found]
        margins[actual.found] = singularity_margin(self.model.mechanism, self.truth, poses, joints)
        return margins

    def can_take(self, commands: PoseBatch) -> Mask:
        """Which of n commands in the convention's frames it can take, clear of singularities."""
        return np.asarray(self.margins(commands) >= self._least_margin)

    def can_stand(self, commands: PoseBatch) -> Mask:
        """Which of n commands it can take with its passive joints and legs within their limits."""
        actual, stands = self.actual_poses(commands), self.can_take(commands)
        poses, joints = actual.poses[stands], actual.joints[stands]
        stands[stands] = self.model.limits.allow_legs(self.model.mechanism, self.truth, poses, joints)
        return stands

    def place(self, command: Pose) -> None:
        """Set the robot to a command at once, without a check of the line.

        Raises:
            ReachError: it cannot take the command clear of singularities.
        """
        actual = self.actual_poses(self.model.from_commands([command]))
        at = self.model.mechanism, self.truth, actual.poses, actual.joints
        if not actual.found[0] or singularity_margin(*at)[0] < self._least_margin:
            raise ReachError(f"this robot cannot reach {command}")
        here = actual.joints if self._joints_commanded is None else self._joints_commanded
        self._stop(command, np.concatenate([here, actual.joints]), actual.poses)

    def move(self, command: Pose) -> None:
        """Move to a command along the controller's straight line.

        Raises:
            LimitError: it is not at any pose yet, or a singularity is on the line.
            ReachError: the controller cannot reach a pose on the line.
        """
        end = self.model.from_commands([command])
        line = interpolate_line(self._commanded, end, PIECES, self.model.frames)
        joints = self._joints(line)
        way = line.in_shape(-1, 1), joints[:, None], self._actual_pose
        traced, found = trace_path(self.model.mechanism, self.truth, *way)
        if not found[0]:
            raise LimitError("a singularity is on the line")
        self._stop(command, joints, traced.in_shape(-1))

    def load(self, model: Robot) -> None:
        """Have the controller command with another geometry, that of ``model``; the joints stay.

        Raises:
            LimitError: no pose of that geometry belongs to the joint variables.
        """
        found = continue_solution(
            model.mechanism,
            model.commanding,
            self._joints(self._commanded),
            start=self._commanded,
            start_geometry=self.model.commanding,
        )
        if not found.found[0]:
            raise LimitError("no pose of this geometry belongs to the joint variables")
        self.model, self._command = model, model.to_command(found.poses.pose(0))

    def zero_gauges(self) -> None:
        """Zero the gauges: the next record is their zero."""
        self._zero = None

    def measure(self, point: int, orientation: int) -> Record:
        """The record of the present pose, with noise. Raises ``LimitError``: it is not at any pose yet."""
        model = self.model
        shown = model.frames.base.T @ self._actual_pose.positions[0]
        shown = shown + model.noise.gauges_mm * self.random.standard_normal(3)
        joints = self._shown[0] + model.noise.encoders * self.random.standard_normal(len(self._shown[0]))
        self._zero = shown if self._zero is None else self._zero
        deviation = deviation_of(shown - self._zero)
        return Record(point, orientation, self.command, joints_of(joints), deviation, self._directions)

    @property
    def command(self) -> Pose:
        """The present command, in the controller's frames."""
        if self._command is None:
            raise LimitError("the robot is not at any pose yet")
        return self._command

    @property
    def _least_margin(self) -> float:
        return LEAST_MARGIN_SHARE * self.model.limits.singularity_margin

    def _joints(self, commands: PoseBatch) -> Array:
        model = self.model
        return inverse_kinematics(model.mechanism, model.commanding, model.branch, commands)

    def _stop(self, command: Pose, way: Array, poses: PoseBatch) -> None:
        """Stop at the end of a way, joints (k, 6) and poses, or beside it where joints scatter.

        Raises:
            ReachError: no pose belongs to where the joints stopped.
        """
        model, joints, pose = self.model, way[[-1]], poses[[-1]]
        stops = model.noise.stops if self.stops is None else self.stops
        least = least_way(model.mechanism.words.joint_unit, stops)
        self._directions = arrival_directions(way, self._directions, least)
        self._command, self._actual, self._shown = command, pose, joints
        self._joints_commanded = joints
        if not (stops or self.unseen):
            return
        scatter = self.random.standard_normal((2, 1, self.model.mechanism.joint_count))
        self._shown = joints + stops * scatter[0]
        found = continue_solution(
            model.mechanism,
            self.truth,
            self._shown + self.unseen * scatter[1],
            start=pose,
            start_geometry=self.truth,
            start_joints=joints,
        )
        if not found.found[0]:
            raise ReachError(f"this robot cannot reach {command}")
        self._actual = found.poses

    @property
    def _commanded(self) -> PoseBatch:
        return self.model.from_commands([self.command])

    @property
    def _actual_pose(self) -> PoseBatch:
        if self._actual is None:
            raise LimitError("the robot is not at any pose yet")
        return self._actual


def robots_within_tolerances(robot: Robot, count: int, seed: int) -> list[Geometry]:
    """Geometries, each built with errors uniform within the tolerances, in the frame convention.

    The errors are those of all parameters of the drawing, in its frames. A controller whose geometry is not
    the drawing's was calibrated before. Then they are a share of the tolerances, about its geometry.
    """
    mechanism, tolerances = robot.mechanism, robot.tolerances
    drawn, _ = mechanism.normalize_frames(robot.drawing)
    is_as_drawn = robot.commanding.largest_difference(drawn) < AS_DRAWN_MM
    centre = robot.drawing if is_as_drawn else robot.commanding
    widths = tolerances if is_as_drawn else tolerances.scaled(WEAR_SHARE)
    random = np.random.default_rng(seed)
    return [random_robot(mechanism, centre, widths, random) for _ in range(count)]


def random_robot(
    mechanism: Mechanism, drawing: Geometry, tolerances: Tolerances, random: np.random.Generator
) -> Geometry:
    """A robot in the frame convention, built after a drawing with errors uniform within the tolerances."""
    parameters = mechanism.parameters
    widths = tolerances.widths(parameters)
    ball = random.uniform(-tolerances.ball_mm, tolerances.ball_mm, 3) @ parameters.ball_offset
    built = Geometry(parameters, drawing.vector + random.uniform(-widths, widths) + ball)
    return mechanism.normalize_frames(built)[0]


def exact_records(robot: Robot, point: int, poses: PoseBatch) -> Iterator[Record]:
    """The records, without noise, of a robot that is exactly as its controller has it at poses of a point.

    The poses are in the convention's frames, the reference first. The joints go straight from pose to pose;
    from which side they arrive at the first is not known.
    """
    joints, directions = robot.mechanism.inverse(robot.commanding, robot.branch, poses), UNKNOWN
    least = least_way(robot.mechanism.words.joint_unit, robot.noise.stops)
    shown = (poses.positions - poses.positions[:1]) @ robot.frames.base
    for row in range(len(poses)):
        command = robot.to_command(poses.pose(row))
        directions = arrival_directions(joints[max(0, row - 1) : row + 1], directions, least)
        yield Record(point, row + 1, command, joints_of(joints[row]), deviation_of(shown[row]), directions)
