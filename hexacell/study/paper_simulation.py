"""The simulations of Abtahi et al. (2010), section 3.1, repeated: the same records for both estimators.

The robot is that of Table 1. The paper does not say at which points it measures, in which orientations,
what its three angles mean, nor after how many steps it stops. Here the points are P1 to P5 of Table 3, the
first m of them; each of three angles about fixed axes is drawn between plus and minus 30 deg; and it stops
where a step changes nothing any more.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.model import CellSettings
from hexacell.errors import ConvergenceError, IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot, robot_of
from hexacell.study.data_sets import unlimited_travel
from hexacell.study.reference_solvers import gauss_newton
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

AMPLITUDE_DEG = 30.0

PAPER_EXACT_MM, PAPER_NOISY_MM = 5e-2, 6e-1
"""Figure 4: two or more points without noise; five points with it."""

PAPER_TABLE_2_MM = {"S": 0.172, "B": 0.572, "l": 0.475}
"""Largest errors of Table 2, by kinds."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One set of records: at how many points, in how many orientations, and the number of the draw."""

    points: int
    orientations: int
    number: int


@dataclass(frozen=True, slots=True)
class Errors:
    """Largest errors of a parameter, mm, by both estimators from the same records.

    Attributes:
        paper: errors of the paper's estimator by kinds of parameters; empty where it came to no end.
        ours: errors of this program's by kinds of parameters; empty where it refuses the records.
    """

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
        float(np.radians(AMPLITUDE_DEG)),
        random,
    )
    exact, noisy = measured.measured(0.0, random), measured.measured(NOISE_MM, random)
    deviation = max(float(np.abs(record.deviation).max()) for record in exact.records)
    return Outcome(_errors(robot, truth, exact), _errors(robot, truth, noisy), deviation)


def _errors(robot: Robot, truth: Geometry, measurements: MeasurementSet) -> Errors:
    problem = robot.problem(measurements)
    paper, ours = dict[str, float](), dict[str, float]()
    with suppress(ConvergenceError):
        paper = _by_kind(gauss_newton(problem, steps=MOST_STEPS, tolerance_mm=SETTLED_MM), truth)
    with suppress(IdentifiabilityError):
        ours = _by_kind(identify(problem, find_outliers=False).geometry, truth)
    return Errors(paper, ours)


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
    """

    trials: int
    settled: int
    refused: int
    paper_mm: float
    ours_there_mm: float
    ours_mm: float

    @classmethod
    def of(cls, errors: Sequence[Errors]) -> "MedianErrors":
        """The medians of the draws' errors."""
        settled = [one for one in errors if one.paper]
        return cls(
            len(errors),
            len(settled),
            sum(not one.ours for one in errors),
            median(one.paper_mm for one in settled),
            median(one.ours_mm for one in settled if one.ours),
            median(one.ours_mm for one in errors if one.ours),
        )


@dataclass(frozen=True, slots=True)
class PlannedSet:
    """Trials that differ by their draw alone, and what came of them."""

    points: int
    exact: MedianErrors
    noisy: MedianErrors
    deviation_mm: float

    @classmethod
    def of(cls, points: int, outcomes: Sequence[Outcome]) -> "PlannedSet":
        """The medians of the draws' outcomes."""
        exact, noisy = (
            MedianErrors.of([getattr(one, name) for one in outcomes]) for name in ("exact", "noisy")
        )
        return cls(points, exact, noisy, median(one.deviation_mm for one in outcomes))


@dataclass(frozen=True, slots=True)
class PaperStudy:
    """The whole study.

    Attributes:
        figures: the sets with one to five points of figures 4 and 5.
        table_2: largest errors with five points and eleven orientations by kinds, medians, mm: by the
            paper's estimator, and by this program's.
    """

    figures: Mapping[int, tuple[PlannedSet, ...]]
    table_2: Mapping[str, Mapping[str, float]]


def trials_of(draws: int) -> list[Trial]:
    """All trials of the study, each kind with so many draws."""
    return [
        Trial(points, orientations, number)
        for orientations in FIGURES.values()
        for points in range(1, MOST_POINTS + 1)
        for number in range(draws)
    ]


def summary(outcomes: Mapping[Trial, Outcome]) -> PaperStudy:
    """The figures of all outcomes, by their trials."""
    found: dict[tuple[int, int], list[Outcome]] = {}
    for one, outcome in outcomes.items():
        found.setdefault((one.points, one.orientations), []).append(outcome)
    most = [one.noisy for one in found[MOST_POINTS, FIGURES[4]]]
    return PaperStudy(
        {
            figure: tuple(PlannedSet.of(n, found[n, count]) for n in range(1, MOST_POINTS + 1))
            for figure, count in FIGURES.items()
        },
        {
            symbol: {
                "paper_mm": median(one.paper[symbol] for one in most if one.paper),
                "ours_mm": median(one.ours[symbol] for one in most if one.ours),
            }
            for symbol in PAPER_TABLE_2_MM
        },
    )


def median(values: Iterable[float]) -> float:
    """The median of some values; NaN where there are none."""
    found = list(values)
    return float(np.median(found)) if found else float("nan")


PAPER = Study("paper", "trials", trials_of, run_trial, Outcome, summary)
"""The paper's simulations."""
