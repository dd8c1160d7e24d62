"""A machine with systematic effects, solved by leg equations alone, and the estimate from its records."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Prior
from hexacell.identification.solver.fit import FINE, solve
from hexacell.identification.solver.measurement_model import predict
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.limits.limits import Limits
from hexacell.measurements.records import MeasurementSet
from hexacell.uncertainty.propagation import Propagation
from tests.hexacell.conftest import vector

Array = NDArray[np.float64]
Machine = Callable[[Array], tuple[Geometry, Array]]
"""What a machine really is when its encoders show something: its geometry, and where its sliders stand."""

NOISE_MM = 0.01


def belief_of(found: Identification, controller: Geometry, branch: Branch) -> RobotBelief:
    problem = found.problem
    limits = Limits(np.inf, np.inf, -np.inf, np.inf, 0.0)
    return RobotBelief(
        problem.mechanism, controller, branch, found.free, found.free_covariance, problem.noise, limits
    )


def poses_of(points: Array, angles: list[tuple[float, float, float]]) -> PoseBatch:
    return PoseBatch.of(Pose(x, y, z, *turn) for (x, y, z), turn in product(points.tolist(), angles))


@dataclass(frozen=True, eq=False)
class Laboratory:
    """Exact records of the robot of Table 1, and what is found if the machine is not as modelled."""

    paper: Any
    legs: Any
    visits: Any
    make_problem: Any
    task: PoseBatch
    workspace: PoseBatch

    def identified(self, measurements: MeasurementSet | None = None) -> Identification:
        measured = self.visits.measured() if measurements is None else measurements
        return identify(self.make_problem(measured), find_outliers=False)

    def updated(self, found: Identification, measurements: MeasurementSet) -> Identification:
        """The estimate of further records, its prior being that of earlier ones."""
        prior = Prior(found.geometry, found.free, found.free_covariance)
        problem = replace(self.make_problem(measurements), prior=prior)
        start = problem.solve_poses(found.free)
        assert start.found.all()
        solution = solve(problem, prior.precision, predict(problem, found.free, start.poses), FINE)
        return Identification(problem, solution, prior.precision)

    def propagation(self, found: Identification, earlier: Mapping[str, Array] | None = None) -> Propagation:
        belief = belief_of(found, self.paper.nominal, self.paper.branch)
        return Propagation(found, belief, self.task, self.workspace, earlier or {})

    def records_of(self, machine: Machine) -> MeasurementSet:
        """Its exact records: the encoders show what they did, the ball is elsewhere."""
        balls = np.array(
            [
                self.reached(machine, joints, PoseBatch(ball[None], rotation[None]))[:3]
                for joints, ball, rotation in zip(
                    self.visits.joints, self.visits.balls, self.visits.rotations, strict=True
                )
            ]
        )
        measured: MeasurementSet = replace(self.visits, balls=balls).measured()
        return measured

    def reached(self, machine: Machine, shown: Array, near: PoseBatch) -> Array:
        """Position and rotation vector (6,) of the platform when the encoders show some joint variables."""
        geometry, joints = machine(shown)
        found: Array | None = self.legs(geometry).closed(joints, vector(near.pose(0)))
        assert found is not None
        return found

    def errors(self, machine: Machine, commanding: Geometry, poses: PoseBatch) -> Array:
        """Errors (n, 6) of a machine commanded under a geometry, in the frames of that geometry."""
        rows = []
        for row in range(len(poses)):
            pose = poses[[row]]
            reached = self.reached(machine, self.legs(commanding).joints(vector(pose.pose(0))), pose)
            turned = Rotation.from_rotvec(reached[3:]) * Rotation.from_matrix(pose.rotations[0]).inv()
            rows.append(np.concatenate([reached[:3] - pose.positions[0], turned.as_rotvec()]))
        return np.array(rows)

    def task_errors(self, machine: Machine, commanding: Geometry) -> Array:
        """The same at the task poses, less what the best frames over the workspace explain."""
        errors = self.errors(machine, commanding, self.workspace)
        design = frame_design(self.workspace)
        scale = np.tile(np.repeat([1.0, self.radius], 3), len(errors))
        best = np.linalg.lstsq(scale[:, None] * design, scale * errors.ravel())[0]
        left = self.errors(machine, commanding, self.task).ravel() - frame_design(self.task) @ best
        return left.reshape(-1, 6)

    @property
    def radius(self) -> float:
        return float(np.linalg.norm(self.paper.actual["B"], axis=1).mean())

    def changed(self, **kinds: Array) -> Geometry:
        """The robot of Table 1 with other values of some kinds."""
        values = {symbol: self.paper.actual[symbol] for symbol in "SBl"} | kinds
        return Geometry.of(HEXAGLIDE_PARAMETERS, values)


def frame_design(poses: PoseBatch) -> Array:
    """What shifting and turning the base frame and turning the platform frame do (6 n, 9)."""
    rows = []
    for position, rotation in zip(poses.positions, poses.rotations, strict=True):
        turning = np.cross(np.eye(3), position).T
        zero = np.zeros((3, 3))
        rows.append(np.block([[np.eye(3), turning, zero], [zero, np.eye(3), rotation]]))
    return np.concatenate(rows)


@pytest.fixture(scope="package")
def laboratory(paper, legs, visit, make_problem) -> Laboratory:
    angles = [(0.0, 0.0, 0.0), (12.0, 0.0, 0.0), (0.0, -12.0, 5.0)]
    task = [Pose(50.0, -50.0, 550.0, 5.0, 15.0, 0.0), Pose(-50.0, 80.0, 500.0, 0.0, -10.0, 20.0)]
    workspace = poses_of(paper.points[:4], angles)
    return Laboratory(paper, legs, visit(seed=2), make_problem, PoseBatch.of(task), workspace)


@pytest.fixture(scope="package")
def exact(laboratory: Laboratory) -> Identification:
    """The robot of Table 1 from exact records, which gives its geometry."""
    return laboratory.identified()


@pytest.fixture(scope="package")
def propagation(laboratory: Laboratory, exact: Identification) -> Propagation:
    return laboratory.propagation(exact)
