"""Calibrations of random robots: what orientations, travel, tilt, noise and points are worth.

The cell is the bundled one with Table 1's drawing. Each robot is built after it with errors that are
uniform within the tolerances, the same for all that is compared.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot, robot_of
from hexacell.robot.virtual_robot import random_robot
from hexacell.study.design_records import ChosenRecords, OrientationChoice, chosen_records
from hexacell.study.tasks import Study

RECORDS = 55
SEED = 18
ROUNDING = 1e-14
"""Share of the largest eigenvalue of the information below which a direction is not determined."""

SWEPT = 20
"""Largest number of robots of each sweep."""

SWEEPS = {
    "gauge travel, mm": ("travel_mm", (1.5, 2.5, 3.5, 5.0)),
    "largest tilt, deg": ("tilt_deg", (15.0, 30.0, 45.0, 60.0)),
    "noise, mm": ("noise_mm", (0.002, 0.005, 0.01, 0.02, 0.05)),
    "points": ("points", (2, 3, 4, 5)),
}
"""The field of a trial that is varied and its values, by the names of the sweeps."""


@dataclass(frozen=True, slots=True)
class DesignTrial:
    """One robot, by its number, and how it is calibrated; its records are divided among the points."""

    number: int
    choice: OrientationChoice = OrientationChoice.ADAPTIVE
    travel_mm: float = 5.0
    tilt_deg: float = 45.0
    noise_mm: float = 0.01
    points: int = 5


@dataclass(frozen=True, slots=True)
class RecordsAccuracy:
    """How well some records determine the robot.

    Attributes:
        largest_mm: largest error of a parameter.
        sigma_mm: root mean square of the parameters' standard deviations by the records alone, without the
            drawing: the noise on them; infinite where they do not determine all.
        task_mm: standard deviation of the error at the worst task pose.
    """

    records: int
    largest_mm: float
    sigma_mm: float
    task_mm: float


@dataclass(frozen=True, slots=True)
class DesignOutcome:
    """The outcome of a trial; ``reason`` says why there is nothing.

    Attributes:
        accuracies: with the records of the first two points, three, and so on.
        deviation_mm: the largest that a gauge had to show.
    """

    accuracies: tuple[RecordsAccuracy, ...] = ()
    deviation_mm: float = 0.0
    reason: str = ""

    @property
    def last(self) -> RecordsAccuracy | None:
        """The accuracy with all records; None without any."""
        return self.accuracies[-1] if self.accuracies else None


def run_design_trial(trial: DesignTrial) -> DesignOutcome:
    """Measure and identify."""
    cell, robot = _cell(trial.travel_mm, trial.tilt_deg, trial.noise_mm, trial.points)
    drawing = robot.mechanism, robot.drawing, robot.tolerances
    truth = random_robot(*drawing, np.random.default_rng([SEED, trial.number]))
    random = np.random.default_rng([SEED, trial.number, 1])
    try:
        chosen = chosen_records(trial.choice, cell.settings, robot, truth, random)
        points = chosen.measurements.points
        counts = [int(np.count_nonzero(points <= point)) for point in range(2, int(points.max()) + 1)]
        if not counts:
            return DesignOutcome(reason="the robot could be measured at no second point")
        found = [_identified(chosen, count) for count in counts]
        accuracies = tuple(_accuracy(cell, chosen.robot, one, truth) for one in found if one is not None)
        deviations = [np.abs(record.deviation).max() for record in chosen.measurements.records]
        reason = "" if found[-1] is not None else f"its {len(points)} records do not determine the robot"
        return DesignOutcome(accuracies, float(max(deviations)), reason)
    except HexacellError as error:
        return DesignOutcome(reason=error.problem)


def _identified(chosen: ChosenRecords, count: int) -> Identification | None:
    """The identification by the first records; None where they cannot determine the geometry."""
    some = MeasurementSet(chosen.measurements.records[:count])
    try:
        return identify(chosen.robot.problem(some), find_outliers=False)
    except HexacellError:
        return None


def _accuracy(cell: Cell, robot: Robot, found: Identification, truth: Geometry) -> RecordsAccuracy:
    belief = robot.belief(found)
    error = Task.of(cell.settings, robot, belief).error(belief)
    variances, axes = np.linalg.eigh(found.solution.information)
    is_determined = variances[0] > ROUNDING * variances[-1]
    return RecordsAccuracy(
        found.records,
        found.geometry.largest_difference(truth),
        float(np.sqrt(np.mean(np.sum(axes**2 / variances, axis=-1)))) if is_determined else float("inf"),
        float("nan") if error is None else error.worst(belief.covariance),
    )


@cache
def _cell(travel_mm: float, tilt_deg: float, noise_mm: float, points: int) -> tuple[Cell, Robot]:
    """The bundled cell with other limits, noise and points, and its robot as drawn."""
    cell = load_cell(bundled_config("simulated-hexaglide"))
    before = cell.settings
    plan = before.identification
    settings = before.model_copy(
        update={
            "limits": before.limits.model_copy(update={"gauge_travel_mm": travel_mm, "tilt_deg": tilt_deg}),
            "noise": before.noise.model_copy(update={"encoder": noise_mm, "gauge_mm": noise_mm}),
            "identification": plan.model_copy(
                update={"points": plan.points[:points], "orientations": round(RECORDS / points)}
            ),
        }
    )
    cell = replace(cell, settings=settings)
    return cell, robot_of(cell)


@dataclass(frozen=True, slots=True)
class Spread:
    """Medians of :class:`RecordsAccuracy` over several robots that were identified.

    ``most_mm`` is the largest error of a parameter that 90 % of them stay within.
    """

    robots: int
    largest_mm: float
    most_mm: float
    sigma_mm: float
    task_mm: float

    @classmethod
    def of(cls, found: Sequence[RecordsAccuracy]) -> "Spread":
        """The spread of some accuracies."""
        errors = [one.largest_mm for one in found]
        return cls(
            len(found),
            _quantile(errors, 0.5),
            _quantile(errors, 0.9),
            _quantile([one.sigma_mm for one in found], 0.5),
            _quantile([one.task_mm for one in found], 0.5),
        )


@dataclass(frozen=True, slots=True)
class ChoiceCurve:
    """One way to choose orientations, as :class:`DesignOutcome`, over all robots that were ``tried``."""

    tried: int
    by_records: Mapping[int, Spread]
    deviation_mm: float


@dataclass(frozen=True, slots=True)
class DesignStudy:
    """The whole study.

    Attributes:
        choices: curves by the way to choose orientations.
        sweeps: spreads of adaptive campaigns, by the name and the value of what is varied.
        noise_ratio: by how much the noise on the parameters is smaller than with other orientations, at the
            median of the robots that both identify.
    """

    choices: Mapping[str, ChoiceCurve]
    sweeps: Mapping[str, Mapping[float, Spread]]
    noise_ratio: Mapping[str, float]


def design_trials_of(robots: int) -> list[DesignTrial]:
    """All trials; the usual ones of a sweep are those of the comparison."""
    trials = [DesignTrial(number, choice) for number in range(robots) for choice in OrientationChoice]
    trials += [trial for name in SWEEPS for trials in _swept(name, robots).values() for trial in trials]
    return list(dict.fromkeys(trials))


def _swept(name: str, robots: int) -> dict[float, list[DesignTrial]]:
    field, values = SWEEPS[name]
    usual = [DesignTrial(number) for number in range(min(robots, SWEPT))]
    varied: dict[float, dict[str, Any]] = {float(value): {field: value} for value in values}
    return {value: [replace(trial, **change) for trial in usual] for value, change in varied.items()}


def design_summary(outcomes: Mapping[DesignTrial, DesignOutcome]) -> DesignStudy:
    """The figures of all outcomes, by their trials."""
    robots = sum(one == DesignTrial(one.number) for one in outcomes)
    compared = {
        choice: [outcomes[DesignTrial(number, choice)] for number in range(robots)]
        for choice in OrientationChoice
    }
    adaptive = compared[OrientationChoice.ADAPTIVE]
    others = {choice: found for choice, found in compared.items() if found is not adaptive}
    return DesignStudy(
        {choice.value: _curve(found) for choice, found in compared.items()},
        {
            name: {
                value: Spread.of([last for one in swept if (last := outcomes[one].last)])
                for value, swept in _swept(name, robots).items()
            }
            for name in SWEEPS
        },
        {choice.value: _noise_ratio(adaptive, found) for choice, found in others.items()},
    )


def _curve(outcomes: Sequence[DesignOutcome]) -> ChoiceCurve:
    every = [one for outcome in outcomes for one in outcome.accuracies]
    counts = sorted({one.records for one in every})
    return ChoiceCurve(
        len(outcomes),
        {count: Spread.of([one for one in every if one.records == count]) for count in counts},
        _quantile([one.deviation_mm for one in outcomes if one.accuracies], 0.5),
    )


def _noise_ratio(adaptive: Sequence[DesignOutcome], other: Sequence[DesignOutcome]) -> float:
    both = [(there.last, here.last) for there, here in zip(other, adaptive, strict=True)]
    return _quantile([there.sigma_mm / here.sigma_mm for there, here in both if there and here], 0.5)


def _quantile(values: Sequence[float], share: float) -> float:
    return float(np.quantile(values, share, method="nearest")) if values else float("nan")


DESIGN = Study("design", "calibrations", design_trials_of, run_design_trial, DesignOutcome, design_summary)
