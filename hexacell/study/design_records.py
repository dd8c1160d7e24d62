"""Records of one robot by several ways to choose orientations, equally many at the same points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from hexacell.campaign.dry_run import VirtualCampaign
from hexacell.campaign.forecast import select_sets
from hexacell.campaign.planner import Plan
from hexacell.cell.model import CellSettings
from hexacell.errors import LimitError
from hexacell.experiment_design.candidates import ReachableTargets, commands_for
from hexacell.experiment_design.continuous_design.measure import PointMeasure, WhitenedRecords
from hexacell.experiment_design.criteria import add_information
from hexacell.experiment_design.predicted_records import position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.measurement_model import record_weights
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot_model import Robot
from hexacell.study.data_sets import unlimited_travel
from hexacell.virtual_robot import VirtualRobot

RANDOM_DEG = (20.0, 14.0, 10.0, 7.0, 5.0, 3.5, 2.5, 1.8, 1.2, 0.9, 0.6, 0.4)
"""Amplitudes of random angles, the largest first."""

PAPER_DEG = 30.0
MOST_TRIES = 600


class Choice(StrEnum):
    """How orientations are chosen."""

    ADAPTIVE = "adaptive"
    FIXED = "best fixed"
    SIFTED = "sifted random"
    RANDOM = "random"
    PAPER = "paper"


@dataclass(frozen=True, slots=True, eq=False)
class ChosenRecords:
    """The records, and the robot with all that commanded them."""

    robot: Robot
    measurements: MeasurementSet
    outside: int = 0


def chosen_records(
    choice: Choice, settings: CellSettings, robot: Robot, truth: Geometry, random: np.random.Generator
) -> ChosenRecords:
    """The records of a robot at all points of a cell.

    Raises:
        HexacellError: it cannot be measured like this.
    """
    match choice:
        case Choice.ADAPTIVE:
            plan = Plan(settings, robot, with_forecast=False)
            campaign = VirtualCampaign(plan, VirtualRobot(robot, truth, random))
            campaign.carry_out()
            return ChosenRecords(campaign.plan.robot, campaign.measurements, campaign.outside)
        case Choice.FIXED:
            return ChosenRecords(robot, _visited(robot, truth, _best_fixed(settings, robot, truth), random))
        case Choice.SIFTED:
            sifted = _random(settings, robot, truth, random, RANDOM_DEG[:1], MOST_TRIES)
            return ChosenRecords(robot, sifted)
        case Choice.RANDOM:
            wanted = settings.identification.orientations - 1
            return ChosenRecords(robot, _random(settings, robot, truth, random, RANDOM_DEG, wanted))
        case Choice.PAPER:
            amplitude, count = float(np.radians(PAPER_DEG)), settings.identification.orientations
            drawn = unlimited_travel(robot, truth, _points(settings), count, amplitude, random)
            return ChosenRecords(robot, drawn.measured(robot.noise.gauge_mm, random))


def _points(settings: CellSettings) -> Array:
    return np.array([point[:3] for point in settings.identification.points])


def _best_fixed(settings: CellSettings, robot: Robot, truth: Geometry) -> list[list[Pose]]:
    """The poses that a designer selects, one by one, who knows the robot and commands with its geometry."""
    free, plan = robot.mechanism.convention.free_parameters(truth), settings.identification
    belief, sets = replace(robot.belief(), free=free), []
    for ball in robot.from_commands(Pose(*point) for point in plan.points).positions:
        [poses] = select_sets(belief, ball[None], plan.orientations, plan.seed)
        if len(poses) < plan.orientations:
            raise LimitError("too few poses can be reached at a point")
        targets = ReachableTargets(poses, robot.mechanism.inverse(truth, robot.branch, poses))
        commands, _ = commands_for(belief, targets)
        sets.append([robot.to_command(commands.pose(row)) for row in range(len(commands))])
        information = _information(belief, targets)
        belief = replace(belief, covariance=add_information(belief.covariance, information))
    return sets


def _information(belief: RobotBelief, targets: ReachableTargets) -> Array:
    jacobian, by_joints = position_derivatives(belief, targets)
    records = WhitenedRecords.of(jacobian, record_weights(by_joints, belief.noise))
    return PointMeasure.of_campaign(records, 1).information()[0]


def _visited(
    robot: Robot, truth: Geometry, sets: list[list[Pose]], random: np.random.Generator
) -> MeasurementSet:
    virtual, records = VirtualRobot(robot, truth, random), list[Record]()
    for point, poses in enumerate(sets, start=1):
        virtual.zero_gauges()
        for orientation, pose in enumerate(poses, start=1):
            virtual.place(pose)
            records.append(virtual.measure(point, orientation))
    return MeasurementSet(tuple(records))


def _random(
    settings: CellSettings,
    robot: Robot,
    truth: Geometry,
    random: np.random.Generator,
    amplitudes: Sequence[float],
    tries: int,
) -> MeasurementSet:
    """Orientations drawn at each point with the largest amplitude of which enough stay inside the travel.

    Of ``tries`` orientations those are kept at which the ball does; if these are as many as are wanted, all
    of them must.
    """
    virtual, records = VirtualRobot(robot, truth, random), list[Record]()
    wanted = settings.identification.orientations
    for point, place in enumerate(settings.identification.points, start=1):
        level, of_point = Pose(*place), list[Record]()
        for amplitude in amplitudes:
            virtual.zero_gauges()
            virtual.place(level)
            of_point = [virtual.measure(point, 1)]
            for angles in random.uniform(-amplitude, amplitude, (tries, 3)).tolist():
                if len(of_point) < wanted:
                    pose = Pose(level.x, level.y, level.z, *angles)
                    of_point += _inside(virtual, pose, point, len(of_point) + 1)
            if len(of_point) == wanted:
                break
        if len(of_point) < wanted:
            raise LimitError(f"too few random orientations stay inside the travel at point {point}")
        records += of_point
    return MeasurementSet(tuple(records))


def _inside(virtual: VirtualRobot, pose: Pose, point: int, orientation: int) -> list[Record]:
    """The record of a pose; none where the robot cannot stand, or the ball leaves the travel."""
    if not virtual.can_stand(virtual.model.from_commands([pose]))[0]:
        return []
    virtual.place(pose)
    record = virtual.measure(point, orientation)
    return [record] if virtual.model.limits.room.holds(np.array(record.deviation)) else []
