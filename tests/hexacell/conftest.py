"""The paper's robot, and exact data of it made without any of the code under test.

Source of the numbers: Abtahi et al. 2010, Tables 1, 3 and 4, lengths in mm. Inverse and forward
kinematics here are the leg equations and nothing else, solved in closed form and by scipy's general
root finder with its own finite differences.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.identification.estimator import identify
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import Noise, Prior, Tolerances
from hexacell.identification.problem.problem import Assumptions, Problem
from hexacell.identification.solver.result import Identification
from hexacell.identification.thermal_expansion import ThermalExpansion
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record
from tests.geometries import hexaglide_geometry

Array = NDArray[np.float64]

NOMINAL = hexaglide_geometry(  # Table 1, and Table 4 has the same
    S=[[0.0, -155.0, 0.0], [0.0] * 3, [0.0, 155.0, 0.0], [0.0, 155.0, 0.0], [0.0] * 3, [0.0, -155.0, 0.0]],
    B=[
        [-90, -67, -125],
        [-100, 56, -120],
        [-39, 110, -120],
        [39, 110, -120],
        [100, 56, -120],
        [90, -67, -125],
    ],
    l=[590, 580, 615, 615, 580, 590],
)
ACTUAL = hexaglide_geometry(  # Table 1
    S=[
        [0.861, -160.815, 1.501],
        [0.0] * 3,
        [-0.292, 152.940, 0.0],
        [-2.822, 154.699, 1.649],
        [5.006, -3.088, -1.913],
        [-1.645, -156.057, 3.185],
    ],
    B=[
        [-87.446, -63.909, -123.485],
        [-102.404, 54.881, -118.309],
        [-33.782, 113.953, -118.309],
        [44.446, 109.800, -118.300],
        [103.096, 54.881, -118.309],
        [86.346, -67.912, -130.613],
    ],
    l=[583.941, 578.279, 610.563, 614.068, 585.272, 593.461],
)
CALIBRATED = hexaglide_geometry(  # Table 4: the real robot, its ball 30 mm from where the drawing has it
    S=[
        [1.01, -152.19, -0.80],
        [0.0] * 3,
        [-3.80, 155.29, 0.0],
        [1.08, 155.85, -0.26],
        [-2.34, -2.49, 2.71],
        [-1.45, -155.70, 0.10],
    ],
    B=[
        [-90.04, -67.09, -151.27],
        [-101.49, 56.85, -148.25],
        [-40.43, 107.98, -148.25],
        [40.18, 112.60, -148.96],
        [102.26, 56.85, -148.25],
        [87.99, -68.93, -149.97],
    ],
    l=[590.58, 579.58, 615.75, 619.33, 578.71, 592.50],
)
BRANCH: Branch = (-1, -1, -1, 1, 1, 1)
POINTS = np.array(  # Table 3, P1 to P6
    [[0, 0, 550], [0, -200, 550], [100, -100, 500], [100, 0, 600], [-100, 100, 500], [-100, -50, 450]],
    dtype=float,
)

PAPER_NOISE = Noise(encoder=0.01, gauge_mm=0.01)
PAPER_TOLERANCES = Tolerances({"S": 7.0, "B": 7.0, "l": 7.0})

STAGES = 8
FARTHEST_MM = 120.0
SMALLEST_MARGIN = 0.03


@dataclass(frozen=True)
class Paper:
    """What the paper's tables say."""

    nominal: Geometry = NOMINAL
    actual: Geometry = ACTUAL
    calibrated: Geometry = CALIBRATED
    branch: Branch = BRANCH

    @property
    def points(self) -> Array:
        return POINTS.copy()


@dataclass(frozen=True, eq=False)
class Legs:
    """The six leg equations of a Hexaglide, one leg after the other; mm and rotation vectors, rad."""

    geometry: Geometry

    def errors(self, pose: Array, joints: Array) -> Array:
        """How much too short each leg (6,) is at a position and rotation vector (6,)."""
        sliders = self.geometry["S"] + np.outer(joints, [1.0, 0.0, 0.0])
        ends = pose[:3] + self.geometry["B"] @ turn(pose[3:]).T
        errors: Array = np.sqrt(np.sum((sliders - ends) ** 2, axis=1)) - self.geometry["l"]
        return errors

    def joints(self, pose: Array) -> Array:
        """Where the sliders (6,) must stand; NaN where a leg is too short."""
        rotation = turn(pose[3:])
        places = []
        for S, B, length, side in zip(
            self.geometry["S"], self.geometry["B"], self.geometry["l"], BRANCH, strict=True
        ):
            x, y, z = pose[:3] + rotation @ B - S
            along = length**2 - y**2 - z**2
            places.append(x + side * np.sqrt(along) if along >= 0.0 else np.nan)
        return np.array(places)

    def closed(self, joints: Array, near: Array) -> Array | None:
        """The pose (6,) near another one that closes all legs; none if it is not found."""
        found = root(self.errors, near, args=(joints,), method="hybr", tol=1e-14)
        return found.x if np.abs(found.fun).max() < 1e-10 else None

    def jacobian(self, joints: Array, pose: Array, radius: float = 1.0) -> Array:
        """Of the legs' errors (6, 6) by differences, rotations in mm at a radius."""
        columns = []
        for step in 1e-4 * np.eye(6):
            turned = Rotation.from_rotvec(step[3:] / radius) * Rotation.from_rotvec(pose[3:])
            moved = np.concatenate([pose[:3] + step[:3], turned.as_rotvec()])
            columns.append((self.errors(moved, joints) - self.errors(pose, joints)) / 1e-4)
        return np.transpose(columns)

    def margin(self, joints: Array, pose: Array) -> float:
        """Smallest singular value of the Jacobian, rotations in mean radii."""
        jacobian = self.jacobian(joints, pose, np.linalg.norm(self.geometry["B"], axis=1).mean())
        return float(np.linalg.svd(jacobian, compute_uv=False)[-1])


def turn(vector: Array) -> Array:
    """The matrix (3, 3) of a rotation vector by its quaternion; scipy's takes five times as long."""
    angle = math.sqrt(vector @ vector)
    w, share = math.cos(0.5 * angle), math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    x, y, z = (share * value for value in vector.tolist())
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def vector(pose: Pose) -> Array:
    """A pose as position, mm, and rotation vector, rad (6,), its angles read by scipy."""
    orientation = Rotation.from_euler("xyz", [pose.a, pose.b, pose.c], degrees=True)
    return np.concatenate([[pose.x, pose.y, pose.z], orientation.as_rotvec()])


def reached(true: Geometry, commanding: Geometry, pose: Pose) -> tuple[Array, Array]:
    """Sliders (6,) and true pose (6,) after a command; not a number if it leads through a singularity.

    The machine is bent from the commanding geometry to the true one in small stages, so that it
    stays on its assembly mode.
    """
    here = vector(pose)
    joints, nowhere = Legs(commanding).joints(here), np.full(6, np.nan)
    if np.isnan(joints).any():
        return joints, nowhere
    for stage in range(1, STAGES + 1):
        share = stage / STAGES
        bent = Legs(Geometry(HEXAGLIDE_PARAMETERS, (1.0 - share) * commanding.vector + share * true.vector))
        closed = bent.closed(joints, here)
        if closed is None:
            return joints, nowhere
        here = closed
    return joints, here


@dataclass(frozen=True, eq=False)
class Visits:
    """What a machine did, without noise: commands, sliders (n, 6), and where the platform really was.

    ``balls`` (n, 3) and ``rotations`` (n, 3, 3) are the true pose.
    """

    labels: tuple[tuple[int, int], ...]
    commands: tuple[Pose, ...]
    joints: Array
    balls: Array
    rotations: Array

    def measured(self, noise_mm: float = 0.0, seed: int = 0) -> MeasurementSet:
        """The records of gauges zeroed at each point's first pose, with noise on all that is read."""
        random = np.random.default_rng(seed)
        records = []
        for label, pose, joints, ball in zip(
            self.labels, self.commands, self.joints, self.balls, strict=True
        ):
            reference = self.balls[self.labels.index((label[0], 1))]
            read = joints + noise_mm * random.standard_normal(6)
            seen = ball - reference + noise_mm * random.standard_normal(3)
            records.append(Record(*label, pose, tuple(read.tolist()), tuple(seen.tolist())))
        return MeasurementSet(tuple(records))


@lru_cache
def visits(
    true: Geometry = ACTUAL,
    commanding: Geometry = NOMINAL,
    *,
    points: int = 5,
    orientations: int = 11,
    degrees: float = 30.0,
    seed: int = 0,
) -> Visits:
    """Random angles at the paper's first points, away from singularities and within bounds."""
    random = np.random.default_rng(seed)
    labels = tuple(product(range(1, points + 1), range(1, orientations + 1)))
    done = [_one_visit(true, commanding, POINTS[point - 1], degrees, random) for point, _ in labels]
    commands, joints, poses = zip(*done, strict=True)
    true_poses = np.array(poses)
    turns = Rotation.from_rotvec(true_poses[:, 3:]).as_matrix()
    return Visits(labels, commands, np.array(joints), true_poses[:, :3], turns)


def _one_visit(
    true: Geometry, commanding: Geometry, point: Array, degrees: float, random: np.random.Generator
) -> tuple[Pose, Array, Array]:
    while True:
        pose = Pose(*point.tolist(), *random.uniform(-degrees, degrees, 3).tolist())
        joints, here = reached(true, commanding, pose)
        is_near = np.abs(here[:3] - point).max() <= FARTHEST_MM
        if is_near and Legs(true).margin(joints, here) >= SMALLEST_MARGIN:
            return pose, joints, here


def problem_of(
    measurements: MeasurementSet,
    *,
    drawing: Geometry = NOMINAL,
    controller: Geometry = NOMINAL,
    noise: Noise = PAPER_NOISE,
    tolerances: Tolerances = PAPER_TOLERANCES,
    provisional: tuple[Geometry, ...] = (),
    known: Problem | None = None,
    expansion: ThermalExpansion | None = None,
) -> Problem:
    """The identification of some records on the paper's robot."""
    return Assumptions(
        Hexaglide(),
        controller=CommandingGeometry.of(Hexaglide(), controller),
        branch=BRANCH,
        prior=Prior.of(Hexaglide(), drawing, tolerances),
        noise=noise,
        provisional=provisional,
        expansion=expansion or ThermalExpansion(),
    ).problem(measurements, known)


@pytest.fixture(scope="session")
def bundled_cell() -> Cell:
    """The cell of the demo, on the paper's robot, with gauges exactly along the axes as in the tests."""
    cell = load_cell(bundled_config("simulated-hexaglide"))
    exact = cell.settings.stations.model_copy(update={"alignment_deg": 0.0})
    return replace(cell, settings=cell.settings.model_copy(update={"stations": exact}))


@pytest.fixture(scope="session")
def paper() -> Paper:
    """The tables of the paper."""
    return Paper()


@pytest.fixture(scope="session")
def hexaglide() -> Hexaglide:
    return Hexaglide()


@pytest.fixture(scope="session")
def legs() -> type[Legs]:
    """Kinematics that owe nothing to the code under test."""
    return Legs


@pytest.fixture(scope="session")
def visit() -> Callable[..., Visits]:
    """Exact data of a machine; the same arguments give the same data, computed once."""
    return visits


@pytest.fixture(scope="session")
def make_problem() -> Callable[..., Problem]:
    return problem_of


@pytest.fixture(scope="session")
def noisy() -> MeasurementSet:
    """55 records of the paper's simulated robot with the paper's noise."""
    return visits(seed=2).measured(0.01, seed=1)


@pytest.fixture(scope="session")
def identified(noisy: MeasurementSet) -> Identification:
    """The same, identified."""
    return identify(problem_of(noisy))
