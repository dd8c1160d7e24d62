"""A check passes an unchanged robot, fails a changed one, and says where its records do not suffice."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState
from hexacell.checks.check import FEWEST_POINTS, Check
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.records import MeasurementSet
from hexacell.uncertainty.effect_kinds import common_encoder_scale, encoder_scales
from hexacell.verdict.check_statement import CheckStatement
from hexacell.verdict.decision import Verdict
from tests.hexacell.campaign.conftest import TWO_POINTS, check_of, make, measured_by
from tests.hexacell.conftest import ACTUAL

QUICK = {"identification__points": TWO_POINTS, "noise__encoder": 0.002, "noise__gauge_mm": 0.002}


def make_check(*, calibrated: bool = True, budget: int = 40, **changes: Any) -> Check:
    """A check of the paper's robot, whose controller has its true geometry, with quick readings."""
    return check_of(make(**QUICK | changes), ACTUAL, 0.005 if calibrated else None, budget=budget)


def carried_out(check: Check, truth: Geometry, seed: int = 1) -> CampaignState:
    return measured_by(check.plan, truth, np.random.default_rng(seed))


def changed(check: Check, change: np.ndarray) -> Geometry:
    convention = check.robot.mechanism.convention
    return convention.geometry(convention.free_parameters(check.robot.commanding) + change)


def said(check: Check, measurements: MeasurementSet) -> CheckStatement:
    stated = check.final_statement(measurements, check.effects)
    assert stated is not None
    return stated


@pytest.fixture(scope="module")
def unchanged() -> tuple[Check, CampaignState]:
    check = make_check()
    return check, carried_out(check, check.robot.commanding, seed=2)


def test_an_unchanged_robot_passes_before_the_budget_is_used(unchanged) -> None:
    check, state = unchanged
    stated = said(check, state.measurements)
    assert stated.verdict is Verdict.PASS
    assert stated.errors.position.value + stated.errors.position.expanded <= 0.15
    assert stated.drift_scale == 1.0
    assert stated.records == len(state.measurements) < check.budget
    assert stated.further_records is None


def test_a_check_measures_at_two_points_at_least(unchanged) -> None:
    check, state = unchanged
    _, records = np.unique(state.measurements.points, return_counts=True)
    assert len(records) == FEWEST_POINTS
    assert records.min() >= 2
    at_first = MeasurementSet(tuple(r for r in state.measurements.records if r.point == 1))
    assert check.reached_at(1, at_first) is not None
    assert check.reached(at_first) is None
    assert check.reached(state.measurements) is not None


def test_a_robot_that_was_hit_fails() -> None:
    check = make_check()
    state = carried_out(check, changed(check, 0.4 * np.random.default_rng(3).standard_normal(35)))
    stated = said(check, state.measurements)
    assert stated.verdict is Verdict.FAIL
    assert stated.drift_scale is not None
    assert stated.drift_scale >= 10.0


def test_without_enough_records_it_is_not_evaluated_and_says_how_many_would_do() -> None:
    check = make_check(noise__encoder=0.01, noise__gauge_mm=0.01, budget=6)
    state = carried_out(check, check.robot.commanding)
    stated = said(check, state.measurements)
    assert stated.records == 6
    assert stated.verdict is Verdict.NOT_EVALUATED
    assert stated.further_records is not None
    assert 1 <= stated.further_records <= 60


def test_readings_that_no_drift_explains_are_not_evaluated(unchanged) -> None:
    check, state = unchanged
    *others, last = state.measurements.records
    false = replace(last, deviation=tuple(value + 1.0 for value in last.deviation))
    stated = said(check, MeasurementSet((*others, false)))
    assert stated.verdict in {Verdict.NOT_EVALUATED, Verdict.FAIL}


def test_without_a_result_a_robot_as_drawn_is_checked_from_its_tolerances(paper) -> None:
    check = make_check(calibrated=False, budget=16)
    truth = check.robot.mechanism.normalize_frames(paper.actual)[0]
    stated = said(check, carried_out(check, truth).measurements)
    assert stated.drift_scale is None
    assert stated.verdict in {Verdict.FAIL, Verdict.NOT_EVALUATED}
    assert stated.errors.position.value > 1.0


def test_systematic_effects_may_forbid_a_pass(unchanged) -> None:
    check, state = unchanged
    effects = (encoder_scales(300.0),)
    stated = said(replace(check, effects=effects), state.measurements)
    assert stated.verdict is not Verdict.PASS
    assert stated.errors.position.expanded > said(check, state.measurements).errors.position.expanded


def test_what_an_effect_did_to_the_earlier_result_is_not_averaged_away(unchanged) -> None:
    """The earlier result and the check err alike, so that the check cannot reduce that error."""
    check, state = unchanged
    effects = (common_encoder_scale(100.0),)
    belief = check.plan.estimate(state).belief
    convention = belief.mechanism.convention
    before = 1e-6 * convention.free_parameters(belief.controller)[:, None]
    shared = said(replace(check, effects=effects, earlier={effects[0].name: before}), state.measurements)
    alone = said(replace(check, effects=effects), state.measurements)
    assert shared.errors.position.expanded != pytest.approx(alone.errors.position.expanded, rel=1e-3)


def test_an_effect_that_was_measured_before_has_its_value_in_the_errors(unchanged) -> None:
    """A common scale of 1e-3: the robot errs by that, whatever the records say."""
    check, state = unchanged
    plain = said(check, state.measurements)
    scale = common_encoder_scale(1e-3)
    known = replace(check, effects=(replace(scale, value=1000.0),))
    stated = said(known, state.measurements)
    (line,) = known.plan.task.budget(stated.estimate.identification, stated.estimate.belief, [scale]).lines
    assert plain.errors.position.value < 0.04
    assert stated.errors.position.value == pytest.approx(1000.0 * line.per_unit_mm, abs=0.05)
    assert stated.errors.position.expanded == pytest.approx(plain.errors.position.expanded, rel=0.6)
