"""The quick level of a robot that drifted keeps its budget and uses what was known before."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState
from hexacell.checks.quick_level import AS_ACCURATE, QuickLevel
from hexacell.dry_run.campaign import try_quick_level
from hexacell.identification.estimator import identify
from hexacell.kinematics.mechanism import free_parameter_derivatives
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.campaign.conftest import check_of, make, measured_by
from tests.hexacell.conftest import ACTUAL

DRIFT_MM = 0.05


def make_quick(*, budget: int = 24, calibrated_mm: float = 0.02) -> QuickLevel:
    plan = make(noise__encoder=0.002, noise__gauge_mm=0.002)
    return QuickLevel(check_of(plan, ACTUAL, calibrated_mm, budget=budget, drift_mm=DRIFT_MM), budget)


def carried_out(quick: QuickLevel) -> tuple[CampaignState, np.ndarray]:
    """On a robot that drifted; and its free parameters."""
    robot, random = quick.check.robot, np.random.default_rng(1)
    convention = robot.mechanism.convention
    by_every = free_parameter_derivatives(robot.mechanism, robot.commanding)
    free = convention.free_parameters(robot.commanding)
    free = free + DRIFT_MM * random.standard_normal(len(by_every)) @ by_every
    return measured_by(quick.plan, convention.geometry(free), random), free


@pytest.fixture(scope="module")
def measured() -> tuple[QuickLevel, CampaignState, np.ndarray]:
    quick = make_quick()
    return quick, *carried_out(quick)


def test_the_budget_is_kept_and_said(measured) -> None:
    quick, state, _ = measured
    said = quick.accuracy(state.measurements)
    assert said is not None
    assert said.records == len(state.measurements) <= quick.budget
    errors = [said.error_mm, *(one.error_mm for one in said.further)]
    assert errors == sorted(errors, reverse=True)
    assert said.calibrated_mm == quick.calibrated_mm


def test_it_ends_when_the_robot_is_known_as_well_as_before() -> None:
    """The larger the errors that the calibration left, the fewer records are as good."""
    quick = make_quick(budget=60, calibrated_mm=0.3)
    state, _ = carried_out(quick)
    said = quick.accuracy(state.measurements)
    assert said is not None
    assert said.error_mm <= AS_ACCURATE * said.calibrated_mm
    assert said.records_to_calibrated == 0
    assert len(state.measurements) < quick.budget
    # One record fewer would not have been enough, or would have determined no geometry.
    assert quick.reached(state.measurements) is not None
    few = MeasurementSet(state.measurements.records[:10])
    assert quick.reached(few) is None


def test_what_was_known_before_counts(measured) -> None:
    """By the records alone the same robot is known worse."""
    quick, state, _ = measured
    robot = quick.robot_after(state.measurements)
    with_it, without = (
        identify(one.problem(state.measurements)) for one in (robot, replace(robot, known=None))
    )
    error = quick.plan.task.error(robot.belief(with_it))
    assert error is not None
    assert error.worst(with_it.free_covariance) < 0.9 * error.worst(without.free_covariance)


def test_parameters_are_undetermined_by_the_drawing_and_not_by_the_last_result(measured) -> None:
    quick, state, _ = measured
    found = identify(quick.robot_after(state.measurements).problem(state.measurements))
    assert found.undetermined == ()
    known = replace(quick.robot_after(state.measurements), known=quick.expected)
    assert identify(known.problem(state.measurements)).undetermined != ()


def test_a_trial_predicts_what_a_run_gives(measured) -> None:
    _, state, _ = measured
    tried = try_quick_level(make_quick())
    assert tried.accuracy is not None
    assert abs(tried.accuracy.records - len(state.measurements)) <= 8
    assert tried.points >= 2
    assert tried.minutes > 0.0
