"""Identifications that several tests look at, computed once."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.altered_records import altered

NOISE_MM = 0.01
REPETITIONS = range(100, 140)


@pytest.fixture(scope="session")
def repeated(visit: Any, make_problem: Any) -> Sequence[Identification]:
    """One measurement again and again: the same poses, other noise."""
    exact = visit(seed=2)
    return [identify(make_problem(exact.measured(NOISE_MM, seed))) for seed in REPETITIONS]


@pytest.fixture(scope="session")
def spoil() -> Callable[..., MeasurementSet]:
    """A copy of a measurement set with something added to one record."""

    def spoilt(
        measurements: MeasurementSet,
        label: tuple[int, int],
        *,
        joints: Sequence[float] = (0, 0, 0, 0, 0, 0),
        deviation: Sequence[float] = (0, 0, 0),
    ) -> MeasurementSet:
        return altered(
            measurements,
            lambda r: {"joints": np.add(r.joints, joints), "deviation": np.add(r.deviation, deviation)},
            lambda r: r.id == label,
        )

    return spoilt
