"""A whole calibration of a virtual robot: measured as planned, identified, written, and verified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexacell.campaign.dry_run import VirtualCampaign
from hexacell.campaign.planner import Plan
from hexacell.campaign.teaching import as_written
from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.controller_config.interface import ControllerGeometry
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.reporting.verification import HeldOut, Verification, verify
from hexacell.robot_model import Robot, make_robot
from hexacell.virtual_robot import VirtualRobot, random_robot
from procedures.calibration.held_out_poses import HeldOutPoses

HELD_OUT_FROM = 100
"""Points of the held-out records, which are of no other records."""

CANDIDATES = 512


@dataclass(frozen=True, slots=True, eq=False)
class VirtualCalibration:
    """A calibration; ``after`` is the robot with the result in its controller."""

    found: Identification
    after: Robot
    verification: Verification
    records: int


def robot_that_reaches(cell: Cell, robot: Robot, random: np.random.Generator) -> Geometry:
    """A geometry within the tolerances that can stand at all points as its controller sends it there."""
    while True:
        truth = random_robot(robot.mechanism, robot.drawing, robot.tolerances, random)
        poses = robot.from_commands(Pose(*point) for point in cell.settings.identification.points)
        if VirtualRobot(robot, truth).can_take(poses).all():
            return truth


def robot_that_stands(cell: Cell, robot: Robot, random: np.random.Generator) -> Geometry:
    """A robot whose passive joints and legs keep their limits too, at all points as it is sent there.

    Another one would stand at a stop of a joint before it was calibrated.
    """
    while True:
        truth = robot_that_reaches(cell, robot, random)
        if stands_at(robot, truth, cell.settings.identification.points):
            return truth


def stands_at(robot: Robot, truth: Geometry, points: Sequence[Sequence[float]]) -> bool:
    """Whether passive joints and legs keep their limits at some commands in the controller's frames."""
    commands = robot.from_commands(Pose(*point) for point in points)
    actual = robot.commanded(truth).actual_poses(commands)
    if not actual.found.all():
        return False
    kept = robot.limits.allow_legs(robot.mechanism, truth, actual.poses, actual.joints)
    return bool(kept.all())


def calibrate(cell: Cell, robot: Robot, truth: Geometry, random: np.random.Generator) -> VirtualCalibration:
    """Measure, identify, write and verify.

    Raises:
        HexacellError: a run would end with this message.
    """
    virtual = VirtualRobot(robot, truth, random)
    campaign = VirtualCampaign(Plan(cell.settings, robot, with_forecast=False), virtual)
    campaign.carry_out()
    measured = campaign.plan.robot  # with the geometries that commanded the records
    found = identify(measured.problem(campaign.measurements))
    written = as_written(cell.settings, robot, found.geometry).geometry
    after = make_robot(cell.settings, ControllerGeometry(written, robot.branch), taught=written)
    held_out = measured_held_out(cell.settings, found, after, VirtualRobot(after, truth, random))
    verification = verify(cell.settings, after, found, held_out)
    return VirtualCalibration(found, after, verification, len(campaign.measurements))


def measured_held_out(
    settings: CellSettings, found: Identification, robot: Robot, virtual: VirtualRobot
) -> HeldOut:
    """What the held-out poses give, chosen as a run does after the identification.

    A point at which the robot would leave its limits is left, if there is none near it.

    Raises:
        LimitError: all of them are.
    """
    records: list[Record] = []
    chosen = HeldOutPoses(settings, robot, CANDIDATES).before(found)
    for number, poses in enumerate(chosen, start=HELD_OUT_FROM):
        virtual.zero_gauges()
        for orientation, pose in enumerate(poses, start=1):
            virtual.place(Pose(*pose))
            records.append(virtual.measure(number, orientation))
    deviations = [record.deviation for record in records if record.orientation > 1]
    return HeldOut(MeasurementSet(tuple(records)), deviations, deviations)
