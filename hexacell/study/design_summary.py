"""What many calibrations of random robots say together: accuracy against records, and what limits it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexacell.study.design_records import OrientationChoice
from hexacell.study.design_trials import DesignOutcome, DesignTrial, RecordsAccuracy, run_design_trial
from hexacell.study.tasks import Study

SWEPT = 20
"""Robots of each sweep, at most."""

TRAVELS_MM = (1.5, 2.5, 3.5, 5.0)
TILTS_DEG = (15.0, 30.0, 45.0, 60.0)
NOISES_MM = (0.002, 0.005, 0.01, 0.02, 0.05)
POINTS = (2, 3, 4, 5)
SWEEPS = {
    "gauge travel, mm": ("travel_mm", TRAVELS_MM),
    "largest tilt, deg": ("tilt_deg", TILTS_DEG),
    "noise, mm": ("noise_mm", NOISES_MM),
    "points": ("points", POINTS),
}
"""By their names: what of a trial is varied, and its values."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Of several robots: the median of the largest error of a parameter, what 90 % stay within, and others.

    Attributes:
        robots: how many were identified.
        sigma_mm: median of the noise on the parameters.
        task_mm: median of the error at the worst task pose, one standard deviation.
    """

    robots: int
    largest_mm: float
    most_mm: float
    sigma_mm: float
    task_mm: float

    @classmethod
    def of(cls, found: Sequence[RecordsAccuracy]) -> Spread:
        """Of accuracies."""
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
    """One way to choose orientations.

    Attributes:
        tried: robots.
        by_records: with the records of the first two points, three, and so on.
        deviation_mm: median of the largest that a gauge had to show.
        outside: poses of all robots at which the ball left the travel.
    """

    tried: int
    by_records: Mapping[int, Spread]
    deviation_mm: float
    outside: int


@dataclass(frozen=True, slots=True)
class DesignStudy:
    """All of it.

    Attributes:
        choices: by the way to choose orientations.
        sweeps: of adaptive campaigns, by the name and the value of what is varied.
        noise_ratio: by how much the noise on the parameters is smaller than with other orientations, at the
            median of the robots that both identify.
    """

    choices: Mapping[str, ChoiceCurve]
    sweeps: Mapping[str, Mapping[float, Spread]]
    noise_ratio: Mapping[str, float]


def design_trials_of(robots: int) -> dict[str, DesignTrial]:
    """All trials by their keys."""
    trials = [DesignTrial(number, choice) for number in range(robots) for choice in OrientationChoice]
    trials += [trial for name in SWEEPS for trials in _swept(name, robots).values() for trial in trials]
    return {trial.key: trial for trial in trials}


def _swept(name: str, robots: int) -> dict[float, list[DesignTrial]]:
    """The trials of a sweep by the value; the usual ones are those of the comparison."""
    field, values = SWEEPS[name]

    def trial(number: int, value: float) -> DesignTrial:
        changed: dict[str, Any] = {field: value}
        return DesignTrial(number, **changed)

    numbers = range(min(robots, SWEPT))
    return {float(value): [trial(number, value) for number in numbers] for value in values}


def design_summary(trials: Mapping[str, DesignTrial], outcomes: Mapping[str, DesignOutcome]) -> DesignStudy:
    """The figures of trials and their outcomes, by their keys."""
    compared = {
        choice: {
            one.number: outcomes[key]
            for key, one in trials.items()
            if one == DesignTrial(one.number, choice)
        }
        for choice in OrientationChoice
    }
    robots = len(compared[OrientationChoice.ADAPTIVE])
    sweeps = {
        name: {
            value: Spread.of(_last(outcomes[one.key] for one in swept))
            for value, swept in _swept(name, robots).items()
        }
        for name in SWEEPS
    }
    adaptive = compared[OrientationChoice.ADAPTIVE]
    return DesignStudy(
        {choice.value: _curve(list(found.values())) for choice, found in compared.items()},
        sweeps,
        {
            choice.value: _noise_ratio(adaptive, found)
            for choice, found in compared.items()
            if choice is not OrientationChoice.ADAPTIVE
        },
    )


def _last(outcomes: Iterable[DesignOutcome]) -> list[RecordsAccuracy]:
    return [one.last for one in outcomes if one.last is not None]


def _curve(outcomes: Sequence[DesignOutcome]) -> ChoiceCurve:
    every = [one for outcome in outcomes for one in outcome.accuracies]
    counts = sorted({one.records for one in every})
    return ChoiceCurve(
        len(outcomes),
        {count: Spread.of([one for one in every if one.records == count]) for count in counts},
        _quantile([one.deviation_mm for one in outcomes if one.accuracies], 0.5),
        sum(one.outside for one in outcomes),
    )


def _noise_ratio(adaptive: Mapping[int, DesignOutcome], other: Mapping[int, DesignOutcome]) -> float:
    both = [(one.last, adaptive[number].last) for number, one in other.items()]
    return _quantile([there.sigma_mm / here.sigma_mm for there, here in both if there and here], 0.5)


def _quantile(values: Sequence[float], share: float) -> float:
    return float(np.quantile(values, share, method="nearest")) if values else float("nan")


DESIGN = Study("design", "calibrations", design_trials_of, run_design_trial, DesignOutcome, design_summary)
