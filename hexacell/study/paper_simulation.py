"""The simulations of Abtahi et al. (2010), section 3.1, repeated: the same records for both estimators.

The robot is that of Table 1. The paper does not say at which points it measures, in which orientations,
what its three angles mean, nor after how many steps it stops. Here the points are P1 to P5 of Table 3, the
first m of them; each of three angles is drawn between plus and minus an amplitude; what they mean and how
large they are is swept; and the error is kept after every step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.model import CellSettings
from hexacell.errors import ConvergenceError, IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot, robot_of
from hexacell.study.data_sets import unlimited_travel
from hexacell.study.reference_solvers import gauss_newton_steps
from hexacell.study.tasks import Study

NOISE_MM = 0.01
"""Standard deviation of the noise of every joint variable and deviation, mm."""

MOST_STEPS = 15
SETTLED_MM = 1e-6
"""A step this small is the last one."""

SEED = 2010

MOST_POINTS = 5
FIGURES = {4: 11, 5: 5}
"""Orientations at each point of a figure."""

AMPLITUDES_DEG = (10.0, 20.0, 30.0, 40.0)
STEPS_SHOWN = (3, 5, 10)
"""Steps of Gauss-Newton after which the paper's errors are shown."""

PAPER_EXACT_MM, PAPER_NOISY_MM = 5e-2, 6e-1
"""Figure 4: two or more points without noise; five points with it."""

PAPER_TABLE_2_MM = {"S": 0.172, "B": 0.572, "l": 0.475}
"""Largest errors of Table 2, by kinds."""


class Angles(StrEnum):
    """The meaning of the three angles of an orientation."""

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


@dataclass(frozen=True, slots=True)
class Errors:
    """Largest errors of a parameter, mm, by both estimators from the same records.

    Attributes:
        steps: errors of the paper's estimator after each step of Gauss-Newton, as far as it came.
        is_settled: whether it came to an end.
        paper: errors of the paper's estimator by kinds of parameters; empty where it came to no end.
        ours: errors of this program's by kinds of parameters; empty where it refuses the records.
    """

    steps: tuple[float, ...]
    is_settled: bool
    paper: dict[str, float]
    ours: dict[str, float]

    @property
    def paper_mm(self) -> float:
        """Largest error by the paper's estimator; infinite where it came to no end."""
        return max(self.paper.values(), default=np.inf)

    @property
    def ours_mm(self) -> float:
        """Largest error by this program's estimator; infinite where it refuses."""
        return max(self.ours.values(), default=np.inf)


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a trial; ``deviation_mm`` is the largest that a gauge would have to show."""

    exact: Errors
    noisy: Errors
    deviation_mm: float


def run_trial(trial: Trial) -> Outcome:
    """Measure in a simulation without noise and with it, and identify from both.

    Raises:
        LimitError: too few orientations can be reached.
    """
    robot, truth, settings = bundled_robot("simulated-hexaglide")
    random = np.random.default_rng([SEED, trial.number])
    measured = unlimited_travel(
        robot,
        truth,
        np.array(settings.identification.points[: trial.points]),
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
    try:
        ours = _by_kind(identify(problem, find_outliers=False).geometry, truth)
    except IdentifiabilityError:
        ours = {}
    return Errors(tuple(steps), is_settled, paper, ours)


def _by_kind(found: Geometry, truth: Geometry) -> dict[str, float]:
    symbols = truth.parameters.slices
    return {symbol: float(np.abs(found[symbol] - truth[symbol]).max()) for symbol in symbols}


@cache
def bundled_robot(name: str) -> tuple[Robot, Geometry, CellSettings]:
    """The robot of a bundled cell as drawn, as it is in the frames of the convention, and the settings.

    Its gauges are exactly along the axes, as the paper has them.
    """
    cell = load_cell(bundled_config(name))
    assert cell.settings.simulation is not None  # noqa: S101 - a bundled cell's
    robot, truth = robot_of(cell), cell.settings.simulation.geometry.model_dump()
    robot = replace(robot, noise=replace(robot.noise, alignment=0.0))
    return robot, Geometry.of(robot.mechanism.parameters, truth), cell.settings


@dataclass(frozen=True, slots=True)
class MedianErrors:
    """Medians over several draws of the largest error of a parameter, mm.

    Attributes:
        trials: number of draws.
        settled: in how many the paper's estimator came to its end.
        refused: in how many this program's refused to identify.
        paper_mm: error of the paper's estimator in draws that settled; NaN if no draw did.
        ours_there_mm: error of this program's estimator in these draws; NaN where it refuses all.
        ours_mm: error of this program's estimator in all draws that it identified.
        after_steps_mm: errors of the paper's after some numbers of steps, in all draws that came so far.
    """

    trials: int
    settled: int
    refused: int
    paper_mm: float
    ours_there_mm: float
    ours_mm: float
    after_steps_mm: Mapping[int, float]

    @classmethod
    def of(cls, errors: Sequence[Errors]) -> MedianErrors:
        """The medians of the draws' errors."""
        settled = [one for one in errors if one.is_settled]
        return cls(
            len(errors),
            len(settled),
            sum(not one.ours for one in errors),
            median(one.paper_mm for one in settled),
            median(one.ours_mm for one in settled if one.ours),
            median(one.ours_mm for one in errors if one.ours),
            {steps: median(_after(one, steps) for one in errors) for steps in STEPS_SHOWN},
        )


@dataclass(frozen=True, slots=True)
class PlannedSet:
    """Trials that differ by their draw alone, and what came of them."""

    points: int
    orientations: int
    amplitude_deg: float
    angles: Angles
    exact: MedianErrors
    noisy: MedianErrors
    deviation_mm: float


@dataclass(frozen=True, slots=True)
class PaperStudy:
    """The whole study.

    Attributes:
        figures: the sets with one to five points of figures 4 and 5.
        sweep: five points, eleven orientations; angles of other sizes and meanings.
        table_2: largest errors with five points and eleven orientations by kinds, medians, mm: by the
            paper's estimator, and by this program's.
    """

    figures: Mapping[int, tuple[PlannedSet, ...]]
    sweep: tuple[PlannedSet, ...]
    table_2: Mapping[str, Mapping[str, float]]


Kind = tuple[int, int, float, Angles]
"""Points, orientations, amplitude in deg, and what the angles mean."""


def trials_of(draws: int) -> list[Trial]:
    """All trials of the study, each kind with so many draws."""
    kinds = [*(one for figure in FIGURES for one in _figure_kinds(figure)), *_sweep_kinds()]
    return [
        Trial(points, count, number, amplitude, angles)
        for points, count, amplitude, angles in kinds
        for number in range(draws)
    ]


def summary(outcomes: Mapping[Trial, Outcome]) -> PaperStudy:
    """The figures of all outcomes, by their trials."""
    found: dict[Kind, list[Outcome]] = {}
    for one, outcome in outcomes.items():
        kind = one.points, one.orientations, one.amplitude_deg, one.angles
        found.setdefault(kind, []).append(outcome)
    most = [one.noisy for one in found[_figure_kinds(4)[-1]]]
    return PaperStudy(
        {figure: tuple(_set(one, found[one]) for one in _figure_kinds(figure)) for figure in FIGURES},
        tuple(_set(one, found[one]) for one in _sweep_kinds()),
        {
            symbol: {
                "paper_mm": median(one.paper[symbol] for one in most if one.is_settled),
                "ours_mm": median(one.ours[symbol] for one in most if one.ours),
            }
            for symbol in PAPER_TABLE_2_MM
        },
    )


def _figure_kinds(figure: int) -> list[Kind]:
    return [(points, FIGURES[figure], 30.0, Angles.FIXED_AXES) for points in range(1, MOST_POINTS + 1)]


def _sweep_kinds() -> list[Kind]:
    return [(MOST_POINTS, FIGURES[4], size, angles) for size in AMPLITUDES_DEG for angles in Angles]


def _set(kind: Kind, outcomes: Sequence[Outcome]) -> PlannedSet:
    return PlannedSet(
        *kind,
        MedianErrors.of([one.exact for one in outcomes]),
        MedianErrors.of([one.noisy for one in outcomes]),
        median(one.deviation_mm for one in outcomes),
    )


def _after(errors: Errors, steps: int) -> float:
    """After so many steps; where it came to its end before, the error there; infinite where it left."""
    if len(errors.steps) >= steps:
        return errors.steps[steps - 1]
    return errors.paper_mm


def median(values: Iterable[float]) -> float:
    """The median of some values; NaN where there are none."""
    found = list(values)
    return float(np.median(found)) if found else float("nan")


PAPER = Study("paper", "trials", trials_of, run_trial, Outcome, summary)
"""The paper's simulations."""
