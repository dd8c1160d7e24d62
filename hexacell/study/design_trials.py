"""Calibrations of random robots: what orientations, travel, tilt, noise and points are worth.

The cell is the bundled one with Table 1's drawing. Each robot is built after it with errors that are
uniform within the tolerances, the same for all that is compared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

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

RECORDS = 55
SEED = 18
ROUNDING = 1e-14
"""Of the largest eigenvalue of the information: what is smaller is not determined."""


@dataclass(frozen=True, slots=True)
class DesignTrial:
    """One robot, and how it is calibrated.

    Attributes:
        number: of the robot.
        choice: of orientations.
        travel_mm: of the gauges, to either side.
        tilt_deg: largest tilt.
        noise_mm: of encoders and gauges.
        points: among which the records are divided.
    """

    number: int
    choice: OrientationChoice = OrientationChoice.ADAPTIVE
    travel_mm: float = 5.0
    tilt_deg: float = 45.0
    noise_mm: float = 0.01
    points: int = 5

    @property
    def key(self) -> str:
        """It and no other."""
        limits = f"{self.travel_mm:g} mm, {self.tilt_deg:g} deg, noise {self.noise_mm:g} mm"
        return f"{self.choice}, {limits}, {self.points} points, {self.number}"


@dataclass(frozen=True, slots=True)
class RecordsAccuracy:
    """What some records tell of the robot.

    Attributes:
        records: how many.
        largest_mm: largest error of a parameter.
        sigma_mm: root mean square of the parameters' standard deviations by the records alone, without the
            drawing: the noise on them; infinite where they do not determine all.
        task_mm: the same error's standard deviation at the worst task pose.
    """

    records: int
    largest_mm: float
    sigma_mm: float
    task_mm: float


@dataclass(frozen=True, slots=True)
class DesignOutcome:
    """What came of a trial; ``reason`` says why there is nothing.

    Attributes:
        accuracies: with the records of the first two points, three, and so on.
        deviation_mm: the largest that a gauge had to show.
        outside: poses at which the ball left the travel.
    """

    accuracies: tuple[RecordsAccuracy, ...] = ()
    deviation_mm: float = 0.0
    outside: int = 0
    reason: str = ""

    @property
    def last(self) -> RecordsAccuracy | None:
        """With all records; none where there are none."""
        return self.accuracies[-1] if self.accuracies else None


def run_design_trial(trial: DesignTrial) -> DesignOutcome:
    """Measure and identify."""
    cell, robot = _cell(trial.travel_mm, trial.tilt_deg, trial.noise_mm, trial.points)
    drawing = robot.mechanism, robot.drawing, robot.tolerances
    truth = random_robot(*drawing, np.random.default_rng([SEED, trial.number]))
    random = np.random.default_rng([SEED, trial.number, 1])
    try:
        chosen = chosen_records(trial.choice, cell.settings, robot, truth, random)
        return _outcome(cell, chosen, truth)
    except HexacellError as error:
        return DesignOutcome(reason=error.problem)


def _outcome(cell: Cell, chosen: ChosenRecords, truth: Geometry) -> DesignOutcome:
    points = chosen.measurements.points
    counts = [int(np.count_nonzero(points <= point)) for point in range(2, int(points.max()) + 1)]
    if not counts:
        return DesignOutcome(reason="the robot could be measured at no second point")
    found = [_identified(chosen, count) for count in counts]
    accuracies = tuple(_accuracy(cell, chosen.robot, one, truth) for one in found if one is not None)
    deviations = [np.abs(record.deviation).max() for record in chosen.measurements.records]
    last = found[-1]
    reason = "" if last is not None else f"its {len(points)} records do not determine the robot"
    return DesignOutcome(accuracies, float(max(deviations)), chosen.outside, reason)


def _identified(chosen: ChosenRecords, count: int) -> Identification | None:
    """By the first records; none where they cannot determine the geometry."""
    some = MeasurementSet(chosen.measurements.records[:count])
    try:
        return identify(chosen.robot.problem(some), find_outliers=False)
    except HexacellError:
        return None


def _accuracy(cell: Cell, robot: Robot, found: Identification, truth: Geometry) -> RecordsAccuracy:
    belief = robot.belief(found)
    error = Task.of(cell.settings, robot, belief).error(belief)
    return RecordsAccuracy(
        found.records,
        found.geometry.largest_difference(truth),
        _noise_mm(found),
        float("nan") if error is None else error.worst(belief.covariance),
    )


def _noise_mm(found: Identification) -> float:
    variances, axes = np.linalg.eigh(found.solution.information)
    if variances[0] <= ROUNDING * variances[-1]:
        return float("inf")
    return float(np.sqrt(np.mean(np.sum(axes**2 / variances, axis=-1))))


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
