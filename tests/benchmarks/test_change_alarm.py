"""The alarm of a check: what its first 8 records say of a leg that became 0.05 mm longer or shorter.

Table 1's robot is calibrated once (0.01 mm noise on joint variables and deviations). Its true geometry is
drawn about the result by the result's covariance; then nothing changes, or the length of one leg does. The
poses are those that a check chooses. The same through a day of +-7 K: legs of steel follow the room, each
in its own time, and a thermometer on each tells its temperature to 0.05 K.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from hexacell.checks.change_alarm import ChangeAlarm, change_alarm
from hexacell.checks.check import Check
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.identification.thermal_expansion import ThermalExpansion
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.virtual_robot import VirtualRobot
from tests.benchmarks.figures import at_least, at_most
from tests.benchmarks.machines import Calibrated, calibrated, on_all_cores
from tests.benchmarks.samples import sample

RUNS = sample(__name__, "RUNS")
CHANGE_MM = 0.05
RECORDS = 8
ALLOWANCE = 1.5 / np.sqrt(RUNS)
"""Of a share: three standard deviations of one half."""


STEEL_UM_M_K = 11.5
SWING_K, DAY_H, RECORD_H = 7.0, 24.0, 0.01
THERMOMETER_K = 0.05


@dataclass(frozen=True)
class Robot:
    """One that was checked: the leg that changed, 0 for none, and what is said of it."""

    leg: int
    alarm: ChangeAlarm


@dataclass(frozen=True, eq=False)
class Weather:
    """How much warmer each leg is than at the calibration."""

    at_first_h: float
    lag_h: Array
    swing_k: float

    def warmer(self, record: int) -> Array:
        hour = self.at_first_h + RECORD_H * record - self.lag_h
        warmer: Array = self.swing_k * np.sin(2.0 * np.pi * hour / DAY_H)
        return warmer


def checked(job: tuple[int, int, float]) -> Robot:
    leg, number, swing_k = job
    known = calibrated()
    usual, random = known.check(), np.random.default_rng([8, leg, number])
    check = replace(usual, robot=replace(usual.robot, expansion=ThermalExpansion(STEEL_UM_M_K)))
    assert check.before is not None
    factor = np.linalg.cholesky(check.before.covariance)
    change = factor @ random.standard_normal(len(factor))
    if leg:
        change = change + random.choice([-1.0, 1.0]) * CHANGE_MM * by_length(known, leg)
    weather = Weather(random.uniform(0.0, DAY_H), random.uniform(0.0, 3.0, 6), swing_k)
    alarm = change_alarm(check, records_of(check, change, weather, random), (0.0,) * 6)
    assert alarm is not None
    return Robot(leg, alarm)


def records_of(
    check: Check, change: Array, weather: Weather, random: np.random.Generator
) -> MeasurementSet:
    """Records of a robot whose free parameters differ by (p,), with thermometers that were at 0 before.

    As many even if the check is decided with fewer.
    """
    mechanism, plan = check.robot.mechanism, replace(check.plan, with_forecast=False, goal=None)
    cold = mechanism.convention.geometry(check.robot.free_parameters + change)
    virtual, told = VirtualRobot(check.robot, cold, random), []
    campaign = VirtualCampaign(plan, virtual)
    while (record := len(campaign.measurements)) < RECORDS:
        warmer = weather.warmer(record)
        longer = cold.vector.copy()
        longer[cold.parameters.slices["l"]] *= 1.0 + 1e-6 * STEEL_UM_M_K * warmer
        virtual.truth = mechanism.normalize_frames(Geometry(cold.parameters, longer))[0]
        campaign.step()
        if len(campaign.measurements) > record:
            told.append((*(warmer + THERMOMETER_K * random.standard_normal(6)).tolist(), None))
    pairs = zip(campaign.measurements.records, told, strict=True)
    return MeasurementSet(tuple(replace(one, temperatures=shown) for one, shown in pairs))


def by_length(known: Calibrated, leg: int) -> Array:
    names = known.robot.mechanism.parameters.names
    row: Array = known.by_every[names.index(f"l{leg}")]
    return row


@pytest.mark.parametrize("swing_k", [0.0, SWING_K], ids=["constant", "a day of +-7 K"])
def test_a_leg_that_changed_is_noticed_and_named(figure, swing_k: float):
    calibrated()  # once, before there are more processes
    legs = [0] * RUNS + [number % 6 + 1 for number in range(RUNS)]
    robots = on_all_cores(checked, [(leg, number, swing_k) for number, leg in enumerate(legs)])
    changed = [one for one in robots if one.leg]
    noticed = np.mean([one.alarm.is_raised for one in changed])
    words = f"first 8 records notice {CHANGE_MM} mm of one leg, {RUNS} robots"
    figure(words, noticed, "", at_least(0.95 - ALLOWANCE))
    named = np.mean([one.alarm.leg == one.leg for one in changed])
    figure("  they name the leg", named, "", at_least(0.9 - ALLOWANCE))
    raised = np.mean([one.alarm.is_raised for one in robots if not one.leg])
    figure(f"unchanged robots raise an alarm, {RUNS}", raised, "", at_most(0.01 + ALLOWANCE / 5))
