"""The simulations of Abtahi et al. (2010), section 3.1, repeated: the same records for both estimators.

The robot is that of Table 1. The paper does not say at which points it measures, in which orientations,
what its three angles mean, nor after how many steps it stops. Here the points are P1 to P5 of Table 3, the
first m of them; each of three angles is drawn between plus and minus an amplitude; what they mean and how
large they are is swept; and the error is kept after every step.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.errors import ConvergenceError, IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.identification.problem.problem import Problem
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot, robot_of
from hexacell.study.data_sets import unlimited_travel
from hexacell.study.reference_solvers import gauss_newton_steps

NOISE_MM = 0.01
"""Of every joint variable and deviation, one standard deviation."""

MOST_STEPS = 15
SETTLED_MM = 1e-6
"""A step this small is the last one."""

SEED = 2010


class Angles(StrEnum):
    """What three angles of an orientation mean."""

    FIXED_AXES = "fixed x, y, z"
    ZYZ = "turned z, y, z"
    VECTOR = "rotation vector"

    def turns(self, angles: Array) -> Array:
        """Rotations (n, 3, 3) of angles (n, 3), rad."""
        match self:
            case Angles.FIXED_AXES:
                return rotations.from_angles(angles)
            case Angles.ZYZ:
                matrices: Array = Rotation.from_euler("ZYZ", angles).as_matrix()
                return matrices
            case Angles.VECTOR:
                return rotations.from_vector(angles)


@dataclass(frozen=True, slots=True)
class Trial:
    """One set of records: at how many points, in how many orientations, and the number of the draw."""

    points: int
    orientations: int
    number: int
    amplitude_deg: float = 30.0
    angles: Angles = Angles.FIXED_AXES

    @property
    def key(self) -> str:
        """It and no other."""
        kind = f"{self.angles}, {self.amplitude_deg:g} deg"
        return f"{self.points} x {self.orientations}, {kind}, {self.number}"


@dataclass(frozen=True, slots=True)
class Errors:
    """What both estimators make of the same records; largest errors of a parameter, mm.

    Attributes:
        steps: of the paper's after each step of Gauss-Newton, as far as it came.
        is_settled: whether it came to an end.
        paper: of the kinds of parameters, by the paper's estimator where it came to its end; else empty.
        ours: likewise by this program's; empty where it refuses records that cannot determine the geometry.
    """

    steps: tuple[float, ...]
    is_settled: bool
    paper: dict[str, float]
    ours: dict[str, float]

    @property
    def paper_mm(self) -> float:
        """Of any parameter; infinite where the paper's estimator came to no end."""
        return max(self.paper.values(), default=np.inf)

    @property
    def ours_mm(self) -> float:
        """Likewise of this program's; infinite where it refuses."""
        return max(self.ours.values(), default=np.inf)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a trial; ``deviation_mm`` is the largest that a gauge would have to show."""

    exact: Errors
    noisy: Errors
    deviation_mm: float


def run_trial(trial: Trial) -> Outcome:
    """Measure in a simulation without noise and with it, and identify from both.

    Raises:
        LimitError: too few orientations can be reached.
    """
    robot, truth, points = _table_one()
    random = np.random.default_rng([SEED, trial.number])
    measured = unlimited_travel(
        robot,
        truth,
        points[: trial.points],
        trial.orientations,
        float(np.radians(trial.amplitude_deg)),
        random,
        turns_of=trial.angles.turns,
    )
    exact, noisy = measured.measured(0.0, random), measured.measured(NOISE_MM, random)
    deviation = max(float(np.abs(record.deviation).max()) for record in exact.records)
    return Outcome(_errors(robot, truth, exact), _errors(robot, truth, noisy), deviation)


def _errors(robot: Robot, truth: Geometry, measurements: MeasurementSet) -> Errors:
    problem = robot.problem(measurements)
    steps, found, is_settled = list[float](), None, False
    try:
        for geometry, change in gauss_newton_steps(problem):
            steps.append(geometry.largest_difference(truth))
            if is_settled := change < SETTLED_MM:
                found = geometry
            if is_settled or len(steps) == MOST_STEPS:
                break
    except ConvergenceError:
        pass  # it left the assembly mode, which is_settled says
    paper = {} if found is None else _by_kind(found, truth)
    return Errors(tuple(steps), is_settled, paper, _ours(problem, truth))


def _ours(problem: Problem, truth: Geometry) -> dict[str, float]:
    try:
        return _by_kind(identify(problem, find_outliers=False).geometry, truth)
    except IdentifiabilityError:
        return {}


def _by_kind(found: Geometry, truth: Geometry) -> dict[str, float]:
    symbols = truth.parameters.slices
    return {symbol: float(np.abs(found[symbol] - truth[symbol]).max()) for symbol in symbols}


@cache
def _table_one() -> tuple[Robot, Geometry, Array]:
    """The robot of Table 1 as drawn, as it is in the frames of the convention, and the points."""
    cell = load_cell(bundled_config("simulated-hexaglide"))
    assert cell.settings.simulation is not None  # noqa: S101 - a bundled cell's
    truth = cell.settings.simulation.geometry.model_dump()
    robot = robot_of(cell)
    actual = Geometry.of(robot.mechanism.parameters, truth)
    return robot, actual, np.array(cell.settings.identification.points)
