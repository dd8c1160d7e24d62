"""A robot at several stages of being known, with the paper's Table 1 errors hidden in it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hexacell.identification.belief import RobotBelief
from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.rotations import Array
from hexacell.limits.limits import Limits
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.conftest import BRANCH, NOMINAL

NOISE = Noise(0.01, 0.01)
LIMITS = Limits(
    gauge_travel_mm=5.0,
    tilt=float(np.radians(45.0)),
    joint_min=-800.0,
    joint_max=800.0,
    singularity_margin=0.05,
)


@pytest.fixture(scope="session")
def limits() -> Limits:
    return LIMITS


def known(
    estimate: Identification | Geometry,
    sigma_mm: float = 0.0,
    limits: Limits = LIMITS,
    controller: Geometry = NOMINAL,
) -> RobotBelief:
    """Knowledge by an estimate, or by a geometry and how surely (mm) it is known."""
    if isinstance(estimate, Geometry):
        free = Hexaglide.convention.free_parameters(estimate)
        covariance: Array = sigma_mm**2 * np.eye(len(free))
    else:
        free, covariance = estimate.free, estimate.free_covariance
    return RobotBelief(Hexaglide(), controller, BRANCH, free, covariance, NOISE, limits)


@pytest.fixture(scope="session")
def know() -> Callable[..., RobotBelief]:
    return known


@pytest.fixture(scope="session")
def little(visit: Any, make_problem: Any) -> Identification:
    """After the first three small tilts at the first point."""
    return estimate_online(
        make_problem(visit(points=1, orientations=4, degrees=2.0, seed=5).measured(0.01, 5))
    )


@pytest.fixture(scope="session")
def much(noisy: MeasurementSet, make_problem: Any) -> Identification:
    """After 55 records at five points."""
    return estimate_online(make_problem(noisy))
