"""The length check on machines that have all effects of their grade, and encoders that are wrong alike.

Each cause is drawn; machines are moved, measured and commanded without any propagation to first order. What
is stated after the check, the largest error over the task poses with U, must hold their true one. U of the
scale must hold the true scale.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
import pytest

from hexacell.campaign.planner import Plan
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import RecordPlacement
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot
from hexacell.robot.stated import stated_effects
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.uncertainty.length_check import LengthCheck
from hexacell.uncertainty.length_records import JudgedGeometry, LengthRecords, LengthStandard
from tests.benchmarks.imperfect_machine import ImperfectMachine

MACHINES = int(os.environ.get("ROBOTS", "100"))
COMMON_UM_M = 300.0
"""One standard deviation of the scale that all encoders have alike: ten to twenty times that of a grade."""

SEATING_MM, CERTIFICATE_MM, DISTANCE_MM = 0.003, 0.001, 300.0
SEATS = {
    "along the rails": ((-150.0, 0.0, 500.0), (1.0, 0.0, 0.0)),
    "across": ((0.0, -150.0, 500.0), (0.0, 1.0, 0.0)),
}
POSES = ((0.0, 0.0), (10.0, 0.0), (-10.0, 0.0), (0.0, 10.0), (0.0, -10.0))


@dataclass(frozen=True, eq=False)
class Calibrated:
    """The robot, its records as they are planned, and what was found of it."""

    robot: Robot
    truth: Geometry
    measurements: MeasurementSet
    found: Identification
    task: Task


@pytest.fixture(scope="module")
def calibrated(table_one) -> Calibrated:
    settings = load_cell(bundled_config("simulated-hexaglide")).settings
    robot, truth = table_one.robot, table_one.truth
    plan = Plan(settings, robot, with_forecast=False)
    campaign = VirtualCampaign(plan, VirtualRobot(robot, truth, np.random.default_rng(1)))
    campaign.carry_out()
    found = identify(robot.problem(campaign.measurements), find_outliers=False)
    task = Task.of(settings, robot, robot.belief(found))
    return Calibrated(robot, truth, campaign.measurements, found, task)


def two_seats(
    machine: ImperfectMachine, found: Identification, name: str, random: np.random.Generator
) -> LengthRecords:
    """The records of three mountings of a machine that is commanded with what was found of it."""
    start, direction = (np.array(one) for one in SEATS[name])
    rows = [(number, tilt) for number in (1, 2, 3) for tilt in POSES]
    mountings = np.array([number for number, _ in rows])
    offsets = np.where((mountings % 2 == 0)[:, None], DISTANCE_MM * direction, 0.0)
    commands = PoseBatch.of(
        _pose(start + offset, *tilt) for offset, (_, tilt) in zip(offsets, rows, strict=True)
    )
    robot, noise = machine.robot, machine.robot.noise
    shown = robot.mechanism.inverse(found.geometry, robot.branch, commands)
    missed = machine._missed(len(rows), random)
    poses = machine._poses(shown, commands, np.zeros(len(rows)), np.zeros(3), missed)
    balls = poses.positions + machine._oval(poses.rotations)
    seated = SEATING_MM * random.standard_normal((3, 3))[mountings - 1]
    true = DISTANCE_MM + CERTIFICATE_MM * random.standard_normal()
    seats = balls[0] + offsets * true / DISTANCE_MM + seated
    deviations: Array = balls - seats + noise.gauge_mm * random.standard_normal(balls.shape)
    read = shown + noise.encoder * random.standard_normal(shown.shape)
    commanded = RecordPlacement(robot.mechanism, found.geometry, commands, read, deviations, np.eye(3))
    return LengthRecords.of(commanded, mountings)


def _pose(position: Array, a: float, b: float) -> Pose:
    x, y, z = position.tolist()
    return Pose(x, y, z, a, b)


@pytest.mark.parametrize("grade", ["precision", "ordinary"])
@pytest.mark.parametrize("name", SEATS)
def test_what_is_stated_after_a_length_check_holds(calibrated: Calibrated, grade, name, say) -> None:
    robot, task = calibrated.robot, calibrated.task
    sizes = UncertaintySettings(grade=grade, common_encoder_scale_um_m=COMMON_UM_M)
    settings = load_cell(bundled_config("simulated-hexaglide")).settings
    effects = stated_effects(settings.model_copy(update={"uncertainty": sizes}))
    standard = LengthStandard(DISTANCE_MM, CERTIFICATE_MM, seating_mm=SEATING_MM)
    random = np.random.default_rng(21)
    scale_held, held, agreed, expanded = 0, 0, 0, []
    for _ in range(MACHINES):
        machine = ImperfectMachine.drawn(robot, calibrated.truth, _without_common(sizes), random)
        common = COMMON_UM_M * float(random.standard_normal())
        machine = replace(machine, scales=machine.scales + 1e-6 * common)
        records = machine.records(calibrated.measurements, calibrated.found.poses, random)
        found = identify(robot.problem(records), find_outliers=False)
        belief = robot.belief(found)
        budget = task.budget(found, belief, effects)
        assert budget is not None
        covariance = found.free_covariance * found.goodness.noise_factor**2
        judged = JudgedGeometry(covariance, budget.parameter_columns)
        measured = two_seats(machine, found, name, random)
        check = LengthCheck.of(measured, standard, robot.noise, judged, effects)
        after = task.budget(found, belief, effects, scale=check.observation)
        assert after is not None
        stated = after.errors_of(np.zeros(len(found.free))).position
        true = machine.largest_error(found, task, random)
        scale_held += abs(check.encoders_long_um_m + common) <= check.expanded_um_m
        held += abs(stated.value - true) <= stated.expanded
        agreed += check.agreement.probability >= 1e-3
        expanded.append((check.expanded_um_m, budget.expanded_mm, stated.expanded))
    scale_um_m, before, left = np.mean(expanded, axis=0)
    say(
        f"true scale within U ({scale_um_m:.0f} um/m), {name}, {grade}",
        f"{scale_held / MACHINES:.1%}",
        "93 to 98 %",
    )
    say("  the largest error within U of what is stated", f"{held / MACHINES:.1%}", "93 to 98 %")
    say("  U of that, mm, without the check and with it", f"{before:.3f}, {left:.3f}", "")
    say("  checks whose records agree", f"{agreed / MACHINES:.1%}", "99.9 %")
    assert scale_held / MACHINES > 0.85
    assert held / MACHINES > 0.9
    assert agreed / MACHINES > 0.97


def _without_common(sizes: UncertaintySettings) -> UncertaintySettings:
    return sizes.model_copy(update={"common_encoder_scale_um_m": 0.0})
