"""What many trials of the paper's simulation say together: figures 4 and 5, table 2, and sweeps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.study.definition import Study
from hexacell.study.paper_simulation import Angles, Errors, Outcome, Trial, run_trial

MOST_POINTS = 5
FIGURES = {4: 11, 5: 5}
"""Orientations at each point of a figure."""

AMPLITUDES_DEG = (10.0, 20.0, 30.0, 40.0)
STEPS_TOLD = (3, 5, 10)

PAPER_EXACT_MM, PAPER_NOISY_MM = 5e-2, 6e-1
"""Figure 4: two or more points without noise; five points with it."""

PAPER_TABLE_2_MM = {"S": 0.172, "B": 0.572, "l": 0.475}
"""Largest errors of Table 2, by kinds."""


@dataclass(frozen=True, slots=True)
class MedianErrors:
    """Of several draws: medians of the largest error of a parameter, mm.

    Attributes:
        trials: how many there are.
        settled: in how many the paper's estimator came to its end.
        refused: in how many this program's refused to identify.
        paper_mm: by that, of those; NaN of none.
        ours_there_mm: by this program's estimator, of the same; NaN where it refuses all of them.
        ours_mm: by this program's estimator, of all that it identified.
        after_steps_mm: by the paper's after 3, 5 and 10 steps, of all that came so far.
    """

    trials: int
    settled: int
    refused: int
    paper_mm: float
    ours_there_mm: float
    ours_mm: float
    after_steps_mm: tuple[float, ...]

    @classmethod
    def of(cls, errors: Sequence[Errors]) -> MedianErrors:
        """Of the draws' errors."""
        settled = [one for one in errors if one.is_settled]
        return cls(
            len(errors),
            len(settled),
            sum(not one.ours for one in errors),
            _median(one.paper_mm for one in settled),
            _median(one.ours_mm for one in settled if one.ours),
            _median(one.ours_mm for one in errors if one.ours),
            tuple(_median(_after(one, steps) for one in errors) for steps in STEPS_TOLD),
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
    """All of it.

    Attributes:
        figures: for 4 and 5, the sets with one to five points.
        sweep: five points, eleven orientations; angles of other sizes and meanings.
        table_2: largest errors with five points and eleven orientations by kinds, medians, mm: by the
            paper's estimator, and by this program's.
    """

    figures: Mapping[int, tuple[PlannedSet, ...]]
    sweep: tuple[PlannedSet, ...]
    table_2: Mapping[str, tuple[float, float]]


Kind = tuple[int, int, float, Angles]
"""Points, orientations, amplitude in deg, and what the angles mean."""


def trials_of(draws: int) -> dict[str, Trial]:
    """All trials of the study by their keys, each kind with so many draws."""
    kinds = [*(one for figure in FIGURES for one in _figure_kinds(figure)), *_sweep_kinds()]
    trials = [
        Trial(points, count, number, amplitude, angles)
        for points, count, amplitude, angles in kinds
        for number in range(draws)
    ]
    return {trial.key: trial for trial in trials}


def summary(trials: Mapping[str, Trial], outcomes: Mapping[str, Outcome]) -> PaperStudy:
    """The figures of trials and their outcomes, by their keys."""
    found: dict[Kind, list[Outcome]] = {}
    for key, one in trials.items():
        kind = one.points, one.orientations, one.amplitude_deg, one.angles
        found.setdefault(kind, []).append(outcomes[key])
    most = [one.noisy for one in found[_figure_kinds(4)[-1]]]
    return PaperStudy(
        {figure: tuple(_set(one, found[one]) for one in _figure_kinds(figure)) for figure in FIGURES},
        tuple(_set(one, found[one]) for one in _sweep_kinds()),
        {
            symbol: (
                _median(one.paper[symbol] for one in most if one.is_settled),
                _median(one.ours[symbol] for one in most if one.ours),
            )
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
        _median(one.deviation_mm for one in outcomes),
    )


def _after(errors: Errors, steps: int) -> float:
    """After so many steps; where it came to its end before, the error there; infinite where it left."""
    if len(errors.steps) >= steps:
        return errors.steps[steps - 1]
    return errors.paper_mm


def _median(values: Iterable[float]) -> float:
    found = list(values)
    return float(np.median(found)) if found else float("nan")


PAPER = Study("paper", "trials", trials_of, run_trial, Outcome, summary)
"""The paper's simulations."""
