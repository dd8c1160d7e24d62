"""What has changed from one calibration of a machine to others, parameter by parameter.

The sigmas are those of the noise of the records. Effects that no record shows are mostly the same in all
runs of a machine and take no part in a difference.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from hexacell.errors import UsageError
from hexacell.identification.diagnostics.tolerance_check import SIGNIFICANT_SIGMAS
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.kinematics.parameters import ParameterSet
from hexacell.kinematics.rotations import Array
from hexacell.results.result import IdentificationResult

LEAST_RUNS = 3
"""Fewest runs of a trend: two are compared, and show none."""

DAY_S = 86_400.0

TIED = 1e-12
"""Share of the largest variance below which that of a combination of parameters is rounding."""


@dataclass(frozen=True, slots=True)
class ParameterDifference:
    """A parameter in two results, in its unit; ``sigma`` is one standard deviation of the change."""

    name: str
    unit: str
    before: float
    after: float
    sigma: float

    @property
    def change(self) -> float:
        """The change from the one to the other."""
        return self.after - self.before

    @property
    def is_significant(self) -> bool:
        """Whether it is more than chance of this one parameter."""
        return abs(self.change) > SIGNIFICANT_SIGMAS * self.sigma


@dataclass(frozen=True, slots=True)
class RunComparison:
    """Two results in the same frame convention.

    Attributes:
        test: whether all changes together are explained by the noise of both.
    """

    frame: str
    parameters: tuple[ParameterDifference, ...]
    test: ChiSquareTest

    @property
    def is_changed(self) -> bool:
        """Whether the machine differs by more than the noise of its records."""
        return not self.test.is_explained

    @property
    def significant(self) -> tuple[ParameterDifference, ...]:
        """The parameters that changed significantly, the most significant first."""
        found = [one for one in self.parameters if one.is_significant]
        return tuple(sorted(found, key=lambda one: -abs(one.change) / one.sigma))


@dataclass(frozen=True, slots=True)
class ParameterTrend:
    """A parameter over several runs: its values and sigmas, and the straight line through them.

    ``per_day`` is the slope with its standard deviation ``sigma_per_day``, in the parameter's unit.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    sigmas: tuple[float, ...]
    per_day: float
    sigma_per_day: float

    @property
    def is_walking(self) -> bool:
        """Whether it moves steadily, by more than chance of this one parameter."""
        return abs(self.per_day) > SIGNIFICANT_SIGMAS * self.sigma_per_day


def compare_results(
    parameters: ParameterSet, before: IdentificationResult, after: IdentificationResult
) -> RunComparison:
    """The changes of the free parameters; raises ``UsageError`` if the frame conventions differ."""
    _require_same_frame((before, after))
    old, new = parameters.vector(before.geometry), parameters.vector(after.geometry)
    change = new - old
    covariance = np.array(before.covariance) + np.array(after.covariance)
    sigma = np.sqrt(np.diag(covariance))
    free = np.flatnonzero(sigma > 0.0)
    # The convention ties some parameters to each other: their covariance has a lower rank.
    values, axes = np.linalg.eigh(covariance[np.ix_(free, free)])
    is_own = values > TIED * values.max()
    chi2 = float(np.sum((change[free] @ axes[:, is_own]) ** 2 / values[is_own]))
    numbers = zip(parameters.parameters, old.tolist(), new.tolist(), sigma.tolist(), strict=True)
    differences = tuple(
        ParameterDifference(one.name, one.kind.unit.value, *of_one)
        for one, *of_one in numbers
        if of_one[-1] > 0.0
    )
    return RunComparison(after.frame, differences, ChiSquareTest(chi2, float(is_own.sum())))


def trends(
    parameters: ParameterSet, results: Sequence[tuple[datetime, IdentificationResult]]
) -> tuple[ParameterTrend, ...]:
    """The trend of every free parameter; empty for fewer than three results, or one instant.

    Raises:
        UsageError: the results are in different frame conventions.
    """
    _require_same_frame([result for _, result in results])
    days = np.array([at.timestamp() / DAY_S for at, _ in results])
    if len(results) < LEAST_RUNS or np.ptp(days) == 0.0:
        return ()
    values = np.array([parameters.vector(result.geometry) for _, result in results])
    sigmas = np.array([parameters.vector(result.sigma) for _, result in results])
    return tuple(
        _trend(parameters, row, days, values[:, row], sigmas[:, row])
        for row in np.flatnonzero((sigmas > 0.0).all(axis=0)).tolist()
    )


def _trend(parameters: ParameterSet, row: int, days: Array, values: Array, sigmas: Array) -> ParameterTrend:
    """The weighted straight line (Bevington and Robinson, Data Reduction, 3rd ed. 2003, section 6.3)."""
    weights = sigmas**-2.0
    centred = days - np.average(days, weights=weights)
    information = float(np.sum(weights * centred**2))
    one = parameters.parameters[row]
    return ParameterTrend(
        one.name,
        one.kind.unit.value,
        tuple(values.tolist()),
        tuple(sigmas.tolist()),
        per_day=float(np.sum(weights * centred * values)) / information,
        sigma_per_day=information**-0.5,
    )


def _require_same_frame(results: Sequence[IdentificationResult]) -> None:
    if len({result.frame for result in results}) > 1:
        problem = "these runs have different frame conventions: their numbers cannot be compared"
        raise UsageError(problem, action="Compare runs of one mechanism")
