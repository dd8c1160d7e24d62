"""The alarm of a check: quiet on an unchanged robot, and what it says of one that changed."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.decisions import Finished
from hexacell.checks.change_alarm import FIRST_RECORDS, change_alarm
from hexacell.checks.check import Check
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.kinematics.geometry import Geometry
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.text.verdict import alarm_sentence
from hexacell.uncertainty.effect_kinds import encoder_scales
from tests.hexacell.campaign.conftest import check_of

SCALE_UM_M = 100.0


@pytest.fixture(scope="module")
def check(make_plan, paper) -> Check:
    """Of the paper's robot, whose controller has its true geometry."""
    return check_of(make_plan(), paper.actual, 0.005)


def measured(check: Check, name: str = "", change_mm: float = 0.0, seed: int = 1) -> MeasurementSet:
    """The first records of a robot of which one parameter has changed."""
    vector = check.robot.commanding.vector.copy()
    parameters = check.robot.mechanism.parameters
    if name:
        vector[parameters.names.index(name)] += change_mm
    truth = check.robot.mechanism.normalize_frames(Geometry(parameters, vector))[0]
    return first_records(check, truth, seed)


def first_records(check: Check, truth: Geometry, seed: int = 1) -> MeasurementSet:
    """Of a check that is not decided before."""
    robot = VirtualRobot(check.robot, truth, np.random.default_rng(seed))
    campaign = VirtualCampaign(replace(check.plan, with_forecast=False), robot)
    while len(campaign.measurements) < FIRST_RECORDS:
        assert not isinstance(campaign.step(), Finished)
    return campaign.measurements


def test_an_unchanged_robot_raises_none(check) -> None:
    alarm = change_alarm(check, measured(check))
    assert alarm is not None
    assert (alarm.records, alarm.is_raised) == (FIRST_RECORDS, False)


@pytest.mark.parametrize(("name", "leg"), [("l2", 2), ("l5", 5), ("S2z", 2)])
def test_a_part_that_moved_raises_one_that_names_its_leg(check, name, leg) -> None:
    alarm = change_alarm(check, measured(check, name, 0.08))
    assert alarm is not None
    assert (alarm.is_raised, alarm.leg) == (True, leg)
    assert f"leg {leg}" in alarm_sentence(alarm)


def test_too_few_records_or_no_calibration_raise_none(check) -> None:
    records = measured(check, "l2", 0.08)
    assert change_alarm(check, MeasurementSet(records.records[:-1])) is None
    assert change_alarm(replace(check, before=None), records) is None


def test_effects_that_the_calibration_had_too_are_no_change(check) -> None:
    """Encoder scales made it err; they are the same now and explain the same records."""
    scales = replace(encoder_scales(SCALE_UM_M), size=SCALE_UM_M)
    moved = np.random.default_rng(2).normal(0.0, 2e-4, (len(check.robot.free_parameters), 6))
    known = replace(check, robot=replace(check.robot, effects=(scales,)), earlier={scales.name: moved})
    errs = check.robot.free_parameters + SCALE_UM_M * moved[:, 1]
    truth = check.robot.mechanism.convention.geometry(errs)
    records = first_records(check, truth)
    naive, aware = (change_alarm(one, records) for one in (check, known))
    assert naive is not None
    assert aware is not None
    assert naive.is_raised
    assert aware.score < 0.5 * naive.score


def test_the_expansion_of_the_legs_raises_no_alarm(check) -> None:
    """One leg is warmer than at the calibration, and longer by it; a thermometer on it tells."""
    kelvin, leg = 7.0, 5
    parameters = check.robot.mechanism.parameters
    length = check.robot.commanding.vector[parameters.names.index(f"l{leg}")]
    longer = 1e-6 * check.settings.uncertainty.expansion_legs_um_m_k * length * kelvin
    records = measured(check, f"l{leg}", longer).records
    now = [20.0 + kelvin * (number == leg) for number in range(1, 7)]
    shown = MeasurementSet(tuple(replace(one, temperatures=(*now, None)) for one in records))
    naive, unknown = (change_alarm(check, one) for one in (MeasurementSet(records), shown))
    known = change_alarm(check, shown, (20.0,) * 6)
    assert naive is not None
    assert known is not None
    assert naive.is_raised
    assert not known.is_raised
    assert unknown is None
