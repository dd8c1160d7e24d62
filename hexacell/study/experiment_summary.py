"""What many experiments say together: how far apart places of one point are, before and after."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.study.definition import Study
from hexacell.study.paper_experiment import Differences, Experiment, ExperimentOutcome, run_experiment

REPEATABILITIES_MM = (0.002, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
PAPER_REDUCTION = 0.60
PAPER_REPEATABILITY_MM = 2.0


@dataclass(frozen=True, slots=True)
class Reduction:
    """Medians over the draws of the mean difference at some points, mm.

    Attributes:
        before: with the drawing in the controller.
        paper: with the geometry by the paper's estimator, of the draws in which that ends; NaN of none.
        ours: with that by this program's.
    """

    before: float
    paper: float
    ours: float

    @classmethod
    def of(cls, found: Sequence[Differences]) -> Reduction:
        """Of the draws' differences."""
        return cls(
            _median(one.before for one in found),
            _median(one.paper for one in found),
            _median(one.ours for one in found),
        )


@dataclass(frozen=True, slots=True)
class RepeatabilityRow:
    """All draws with one repeatability; ``ended``: in how many the paper's estimator comes to an end."""

    repeatability_mm: float
    draws: int
    ended: int
    calibrating: Reduction
    verifying: Reduction


@dataclass(frozen=True, slots=True)
class ExperimentStudy:
    """The sweep, and one draw with the paper's repeatability for figures 8 and 9."""

    rows: tuple[RepeatabilityRow, ...]
    example: ExperimentOutcome


def experiments_of(draws: int) -> dict[str, Experiment]:
    """All experiments of the study by their keys, each repeatability with so many draws."""
    every = [Experiment(mm, number) for mm in REPEATABILITIES_MM for number in range(draws)]
    return {one.key: one for one in every}


def experiment_summary(
    experiments: Mapping[str, Experiment], outcomes: Mapping[str, ExperimentOutcome]
) -> ExperimentStudy:
    """The figures of experiments and their outcomes, by their keys."""
    rows = []
    for mm in REPEATABILITIES_MM:
        found = [outcomes[key] for key, one in experiments.items() if one.repeatability_mm == mm]
        rows.append(
            RepeatabilityRow(
                mm,
                len(found),
                sum(bool(one.calibrating.paper) for one in found),
                Reduction.of([one.calibrating for one in found]),
                Reduction.of([one.verifying for one in found]),
            )
        )
    return ExperimentStudy(tuple(rows), outcomes[Experiment(PAPER_REPEATABILITY_MM, 0).key])


def _median(differences: Iterable[Sequence[float]]) -> float:
    means = [float(np.mean(one)) for one in differences if one]
    return float(np.median(means)) if means else float("nan")


EXPERIMENT = Study(
    "experiment", "experiments", experiments_of, run_experiment, ExperimentOutcome, experiment_summary
)
"""The paper's experiment."""
