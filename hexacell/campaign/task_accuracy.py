"""The predicted error at the poses where the robot will work."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from hexacell.cell.model import CellSettings
from hexacell.design.candidates import workspace_poses
from hexacell.errors import HexacellError
from hexacell.identification.belief import RobotBelief
from hexacell.identification.diagnostics.pose_accuracy import error_jacobian
from hexacell.identification.estimator import estimate_online
from hexacell.identification.identified_zeros import HeldParameters, IdentifiedZeros
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot
from hexacell.robot.virtual_robot import exact_records
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.effects import Effect
from hexacell.uncertainty.propagation import Propagation, ScaleObservation


@dataclass(frozen=True, slots=True, eq=False)
class TaskError:
    """How errors of the free parameters change the position at n task poses.

    Attributes:
        jacobian: (n, 3, p) of positions, mm, without what another choice of frames would explain.
        held: parameters that are not identified, if any: their tolerances are part of every error.
        gain: (p, p) with which the others are then identified.
    """

    jacobian: Array
    held: HeldParameters | None = None
    gain: Array | None = None

    def variances(self, covariance: Array) -> Array:
        """Mean square distances (n,), mm^2, under a covariance of the free parameters, and others after."""
        free = self.jacobian.shape[-1]
        covariance = covariance[:free, :free]
        if self.held is not None and self.gain is not None:
            covariance = self.held.covariance(self.gain, covariance)
        flat = self.jacobian.reshape(-1, free)
        squares: Array = np.sum((flat @ covariance) * flat, axis=-1).reshape(self.jacobian.shape[:2])
        return np.asarray(squares.sum(axis=-1))

    def weight(self) -> Array:
        """Weight W (p, p) of the parameters' covariance C: ``tr(W C)`` is the mean square error."""
        squares = np.einsum("nap,naq->pq", self.jacobian, self.jacobian, optimize=True)
        return np.asarray(squares / len(self.jacobian))

    def worst(self, covariance: Array) -> float:
        """One standard deviation at the worst pose, mm."""
        return float(np.sqrt(self.variances(covariance).max()))

    def largest(self, change: Array) -> float:
        """The largest error, mm, by a change (p,) of the parameters, mm."""
        return float(np.linalg.norm(self.jacobian @ change, axis=-1).max())

    def mean_square(self, covariance: Array) -> float:
        """Mean over all poses, mm^2."""
        return float(self.variances(covariance).mean())


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """Task poses, and poses across the workspace over which the frames are fitted.

    Both are in the mechanism's frame convention. Where a cell states no task poses, the workspace
    poses are the task. ``held`` are the parameters that are not identified.
    """

    poses: PoseBatch
    workspace: PoseBatch
    held: HeldParameters | None = None

    @classmethod
    def of(cls, settings: CellSettings, robot: Robot, belief: RobotBelief) -> "Task":
        """The task of a cell; workspace poses are those that a robot as in ``belief`` can take."""
        points = PoseBatch.of(Pose(*point) for point in settings.identification.points)
        workspace = workspace_poses(belief, robot.frames.poses(points).positions)
        stated = robot.from_commands(Pose(*pose) for pose in settings.task.poses)
        poses = stated if len(stated) else workspace
        return cls(poses, workspace if len(workspace) else poses, robot.held)

    def reachable(self, belief: RobotBelief) -> "Task":
        """The poses that the estimated robot reaches."""
        return Task(_reachable(belief, self.poses), _reachable(belief, self.workspace), self.held)

    def budget(
        self,
        found: Identification,
        belief: RobotBelief,
        effects: Iterable[Effect],
        earlier: Mapping[str, Array] | None = None,
        scale: ScaleObservation | None = None,
        zeros: IdentifiedZeros | None = None,
    ) -> UncertaintyBudget | None:
        """The uncertainty of the errors (:class:`.UncertaintyBudget`); None if no task pose is in reach."""
        reached = self.reachable(belief)
        if not len(reached.poses) or not len(reached.workspace):
            return None
        propagation = Propagation(found, belief, reached.poses, reached.workspace, earlier or {}, zeros)
        return UncertaintyBudget.of(propagation, effects, scale)

    def error(self, belief: RobotBelief, recorded: PoseBatch | None = None) -> TaskError | None:
        """How the error depends on the parameters; None if the estimated robot can take no task pose.

        Zeros alone are those with which the ``recorded`` poses will err least; without them, those of the
        workspace.
        """
        if (jacobian := self.jacobian(belief)) is None:
            return None
        return TaskError(jacobian[:, :3], self.held, self._gain(belief, recorded))

    def _gain(self, belief: RobotBelief, recorded: PoseBatch | None) -> Array | None:
        """The gain with which the parameters that are not held are identified; None if all are."""
        if self.held is None:
            return None
        poses = _reachable(belief, self.workspace if recorded is None else recorded)
        radius = float(belief.mechanism.platform_radius(belief.estimate))
        errors = np.repeat([1.0, radius], 3)[:, None] * error_jacobian(belief, poses, poses)
        return self.held.gain(errors.reshape(-1, errors.shape[-1]))

    def jacobian(self, belief: RobotBelief) -> Array | None:
        """Derivatives (n, 6, p) of positions, mm, and rotation vectors, rad, by the free parameters.

        Without what another choice of frames would explain; None if no task pose can be taken.
        """
        reached = self.reachable(belief)
        if not len(reached.poses) or not len(reached.workspace):
            return None
        return error_jacobian(belief, reached.poses, reached.workspace)


def _reachable(belief: RobotBelief, poses: PoseBatch) -> PoseBatch:
    joints = belief.mechanism.inverse(belief.estimate, belief.branch, poses)
    return poses[np.flatnonzero(np.isfinite(joints).all(axis=-1))]


def planned_budget(
    robot: Robot, task: Task, sets: Sequence[PoseBatch], earlier: Mapping[str, Array] | None = None
) -> UncertaintyBudget | None:
    """The uncertainty of the errors at the task poses, with the systematic effects.

    It is that of the result of all poses of the planned ``sets``, for a robot as its controller has it.
    Before all of them are measured the noise is larger by far. None where no such robot can be identified.
    """
    effects = [effect for effect in robot.effects if effect.size]
    records = [*chain.from_iterable(exact_records(robot, *one) for one in enumerate(sets, start=1))]
    try:
        found = estimate_online(robot.problem(MeasurementSet(tuple(records))))
        return task.budget(found, robot.belief(found), effects, earlier)
    except HexacellError:
        return None
