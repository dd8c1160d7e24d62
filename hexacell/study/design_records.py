"""Records of one robot by several ways to choose orientations, equally many at the same points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import islice

import numpy as np

from hexacell.campaign.planner import Plan
from hexacell.cell.model import CellSettings
from hexacell.design.candidates import ReachableTargets, commands_for, reachable_targets
from hexacell.design.criteria import D_OPTIMAL, Criterion, covariance_update
from hexacell.design.predicted_records import (
    GaugeZero,
    PredictedRecords,
    estimate_gauge_zero,
    predict_records,
)
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot.model import Robot
from hexacell.robot.virtual_robot import VirtualRobot
from hexacell.study import data_sets

RANDOM_DEG = (20.0, 14.0, 10.0, 7.0, 5.0, 3.5, 2.5, 1.8, 1.2, 0.9, 0.6, 0.4)
"""Amplitudes of random angles, the largest first."""

PAPER_DEG = 30.0
MOST_TRIES = 600
POSSIBLE = 4096


class OrientationChoice(StrEnum):
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


def chosen_records(
    choice: OrientationChoice,
    settings: CellSettings,
    robot: Robot,
    truth: Geometry,
    random: np.random.Generator,
) -> ChosenRecords:
    """The records of a robot at all points of a cell.

    Raises:
        HexacellError: it cannot be measured like this.
    """
    match choice:
        case OrientationChoice.ADAPTIVE:
            plan = Plan(settings, robot, with_forecast=False)
            campaign = VirtualCampaign(plan, VirtualRobot(robot, truth, random))
            campaign.carry_out()
            return ChosenRecords(campaign.plan.robot, campaign.measurements)
        case OrientationChoice.FIXED:
            virtual, records = VirtualRobot(robot, truth, random), list[Record]()
            for point, poses in enumerate(_best_fixed(settings, robot, truth), start=1):
                virtual.zero_gauges()
                for orientation, pose in enumerate(poses, start=1):
                    virtual.place(pose)
                    records.append(virtual.measure(point, orientation))
            return ChosenRecords(robot, MeasurementSet(tuple(records)))
        case OrientationChoice.SIFTED:
            return ChosenRecords(robot, _random(settings, robot, truth, random, RANDOM_DEG[:1], MOST_TRIES))
        case OrientationChoice.RANDOM:
            wanted = settings.identification.orientations - 1
            return ChosenRecords(robot, _random(settings, robot, truth, random, RANDOM_DEG, wanted))
        case OrientationChoice.PAPER:
            amplitude, count = float(np.radians(PAPER_DEG)), settings.identification.orientations
            points = np.array(settings.identification.points)
            drawn = data_sets.unlimited_travel(robot, truth, points, count, amplitude, random)
            return ChosenRecords(robot, drawn.measured(robot.noise.gauge_mm, random))


def _best_fixed(settings: CellSettings, robot: Robot, truth: Geometry) -> list[list[Pose]]:
    """The poses that a designer selects, one by one, who knows the robot and commands with its geometry."""
    free, plan = robot.mechanism.convention.free_parameters(truth), settings.identification
    belief, sets = replace(robot.belief(), free=free), []
    for ball in robot.from_commands(Pose(*point) for point in plan.points).positions:
        targets, belief = _selected(belief, ball, plan.orientations, plan.seed)
        commands, _ = commands_for(belief, targets)
        sets.append([robot.to_command(commands.pose(row)) for row in range(len(commands))])
    return sets


def _selected(
    belief: RobotBelief, ball: Array, count: int, seed: int
) -> tuple[ReachableTargets, RobotBelief]:
    """Targets with the ball at a place (3,), mm, the level one first, and what is known after them.

    Each of the others gains most of all that are possible beside those before it.
    """
    chosen = reachable_targets(belief, PoseBatch.at(ball, belief.limits.orientations(np.eye(3)[None])))
    if not len(chosen):
        raise LimitError("the level pose cannot be reached at a point")
    possible = possible_targets(belief, _zero(belief, chosen), POSSIBLE, seed)
    possible = possible[commands_for(belief, possible)[1]]
    while len(chosen) < count:
        records = predict_records(belief, _zero(belief, chosen), possible)
        best = int(np.argmax(D_OPTIMAL.gain(belief.covariance, records.jacobian, records.covariance)))
        at_best = belief.covariance, records.jacobian[best], records.covariance[best]
        belief = replace(belief, covariance=covariance_update(*at_best))
        chosen = ReachableTargets.joined([chosen, possible[np.array([best])]])
    return chosen, belief


def possible_targets(belief: RobotBelief, zero: GaugeZero, count: int, seed: int) -> ReachableTargets:
    """The poses, of ``count`` (a power of two) all over tilt and turn, that the estimated robot can take.

    The ball is where the gauges were zeroed, and the robot on the assembly mode that it had there.
    """
    from scipy.stats import qmc  # noqa: PLC0415 - half a second that only this function needs

    heading, tilted, turned = qmc.Sobol(3, seed=seed).random(count).T
    limits, zeros = belief.limits, np.zeros(count)
    angle, heading = limits.tilt * np.sqrt(tilted), 2.0 * np.pi * heading
    directions = np.stack([np.cos(heading), np.sin(heading), zeros], axis=-1)
    turn = limits.turn * (2.0 * turned - 1.0)
    tilts = rotations.from_vector(angle[:, None] * directions)
    turns = rotations.from_vector(np.stack([zeros, zeros, turn], axis=-1))
    poses = PoseBatch.at(zero.reference, limits.orientations(tilts @ turns))
    return reachable_targets(belief, poses, zero.mode(belief))


def _zero(belief: RobotBelief, chosen: ReachableTargets) -> GaugeZero:
    return estimate_gauge_zero(belief, chosen.poses, chosen.joints, np.zeros((len(chosen), 3)))


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
    """The record of a pose; empty where the robot cannot stand, or the ball leaves the travel."""
    if not virtual.can_stand(virtual.model.from_commands([pose]))[0]:
        return []
    virtual.place(pose)
    record = virtual.measure(point, orientation)
    return [record] if virtual.model.limits.room.holds(np.array(record.deviation)) else []


POOL_BATCHES = 10


def chosen_orientations(
    robot: Robot,
    truth: Geometry,
    points: Array,
    orientations: int,
    accurate_at: tuple[Array, float],
    amplitude: float,
    random: np.random.Generator,
) -> data_sets.DataSet:
    """So many orientations within ``amplitude``, rad, at each of some points (m, 3), mm, that we choose.

    It is to be accurate at points (k, 3), mm, within angles of so many rad (``accurate_at``).

    By the drawing alone, before anything is measured, for gauges of any travel: of a pool of random
    orientations at each point, one at a time, that which says most of the position at the poses where the
    robot is to be accurate (I-optimality, :mod:`hexacell.design.criteria`). The first is drawn. The
    ``truth`` decides what can be reached.

    Raises:
        LimitError: a point cannot be reached.
    """
    belief = robot.belief()
    pools = [_pool(robot, truth, point, amplitude, POOL_BATCHES, random) for point in points]
    records = [_records(belief, pool) for pool in pools]
    places, angle = accurate_at
    task = [_records(belief, _pool(robot, truth, place, angle, 1, random)) for place in places]
    squares = (np.einsum("nij,nik->jk", one.jacobian, one.jacobian) / len(one) for one in task)
    criterion = Criterion(sum(squares))
    taken, covariance = [[0] for _ in pools], belief.covariance
    for _ in range(orientations - 1):
        for rows, some in zip(taken, records, strict=True):
            gain = criterion.gain(covariance, some.jacobian, some.covariance)
            gain[rows] = -np.inf
            best = int(gain.argmax())
            rows.append(best)
            covariance = covariance_update(covariance, some.jacobian[best], some.covariance[best])
    return data_sets.data_set(
        robot, [pool[np.array(rows)] for pool, rows in zip(pools, taken, strict=True)], orientations
    )


def _pool(
    robot: Robot, truth: Geometry, point: Array, amplitude: float, batches: int, random: np.random.Generator
) -> data_sets.Reached:
    """What can be reached of some batches of random orientations at a point."""
    turns = islice(data_sets.random_orientations(random, amplitude), batches)
    drawn = (robot.frames.poses(PoseBatch.at(point, each)) for each in turns)
    return data_sets.Reached.joined([data_sets.reached(robot, truth, each) for each in drawn])


def _records(belief: RobotBelief, pool: data_sets.Reached) -> PredictedRecords:
    """The records of a pool, by the drawing, with the gauges zeroed at its first pose."""
    targets = ReachableTargets(pool.commands, pool.joints)
    first = pool[:1]
    zero = estimate_gauge_zero(belief, first.commands, first.joints, np.zeros((1, 3)))
    return predict_records(belief, zero, targets)
