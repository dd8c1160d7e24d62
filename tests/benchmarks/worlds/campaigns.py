"""Fixed campaigns of robots: poses that a run might have chosen, prepared once for a robot."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from hexacell.campaign.forecast import select_sets
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import Cell
from hexacell.design.arrival_sides import WORTH_A_MOVE
from hexacell.design.candidates import orientations, outcomes_of, reachable
from hexacell.design.criteria import D_OPTIMAL, covariance_update
from hexacell.design.predicted_records import position_derivatives
from hexacell.identification.belief import RobotBelief
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.identification.terms.play import every_side
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from tests.benchmarks.machines import bundled, truth_of
from tests.benchmarks.worlds.not_geometry import terms_of
from tests.benchmarks.worlds.world import Commands

TILT_DEG = 45.0
RECORDS = 11
ALIGNMENT_DEG, GAUGE_SCALE = 0.3, 0.001
"""As a cell states them whose gauges are placed by hand; the simulated one has neither."""

MARGIN = 0.05
"""Of the robot without effects from singularities: more than a run keeps, as large effects bend it."""

AIM_MM = 2.5
"""How far the ball is from the gauges' zero at most, along each axis: the travel of a run is used."""

HELD_OUT = 6
HELD_OUT_CANDIDATES = 64
HELD_OUT_SEED, CONFIRMING_SEED = 100, 1_000_100


class UnreachableError(Exception):
    """A robot cannot take a campaign's poses."""


@dataclass(frozen=True, eq=False)
class Setting:
    """A robot, what is measured of it, and its task.

    Attributes:
        truth: its geometry without effects, in the convention's frames.
        commands: of the campaign, through the controller's geometry.
        task: poses of the task, and across the workspace.
        held_out: poses that are commanded through whatever geometry is written.
        confirming: others at the same points, where a test of the model fails narrowly.
    """

    cell: Cell
    robot: Robot
    truth: Geometry
    commands: Commands
    task: Task
    held_out: Commands
    confirming: Commands


@lru_cache
def setting(number: int, candidates: int = 64, terms: tuple[str, ...] = ()) -> Setting:
    """The robot of Table 1 is number 0; others are drawn within the tolerances.

    Args:
        number: of the robot.
        candidates: from so many orientations poses are chosen.
        terms: what of it is not geometry; poses are chosen for these terms beside the geometry.

    Raises:
        UnreachableError: it cannot take the poses; try the next number.
    """
    cell = bundled()
    robot = robot_of(cell)
    robot = replace(
        robot,
        limits=replace(robot.limits, tilt=float(np.radians(TILT_DEG))),
        noise=replace(robot.noise, alignment=float(np.radians(ALIGNMENT_DEG)), gauge_scale=GAUGE_SCALE),
    )
    truth = truth_of(cell, robot, number)
    limits = replace(robot.limits, singularity_margin=MARGIN)
    free = robot.mechanism.convention.free_parameters(truth)
    has = tuple(term for term in terms_of(robot) if term.name in terms)
    known = TermEstimates.expected(has, len(free)) if has else None
    belief = replace(robot.belief(), free=free, limits=limits, terms=known)
    points = robot.frames.poses(
        PoseBatch.of(Pose(*point) for point in cell.settings.identification.points)
    ).positions
    random = np.random.default_rng([17, number])
    parts, labels, sides = [], [], []
    for point, chosen in enumerate(select_sets(belief, points, RECORDS + 4, 1, candidates), start=1):
        aimed = chosen.positions + random.uniform(-AIM_MM, AIM_MM, chosen.positions.shape)
        _, commands = reachable(belief, PoseBatch(aimed, chosen.rotations))
        if len(commands) < RECORDS:
            raise UnreachableError(f"robot {number} takes {len(commands)} poses at point {point}")
        parts.append(commands[:RECORDS])
        sides.append(_best_sides(belief, commands[:RECORDS]))
        labels += [(point, turn) for turn in range(1, RECORDS + 1)]
    task = Task.of(cell.settings, robot, belief)
    return Setting(
        cell,
        robot,
        truth,
        Commands(PoseBatch.joined(parts), np.array(labels), np.concatenate(sides)),
        task,
        _held_out(cell, belief, robot, HELD_OUT_SEED + number),
        _held_out(cell, belief, robot, CONFIRMING_SEED + number),
    )


def _best_sides(belief: RobotBelief, commands: PoseBatch) -> Array:
    """The sides (n, 6) from which joints arrive over waypoints, as a run chooses them; 0 for none.

    Unlike there it is not asked whether the waypoints are clear.
    """
    targets, _ = outcomes_of(belief, commands)
    sides = np.zeros_like(targets.joints)
    if belief.terms is None or not any(term.needs_directions for term in belief.terms.terms):
        return sides
    came, covariance = np.sign(np.diff(targets.joints, axis=0, prepend=0.0)), belief.joint_covariance
    noise = belief.noise.record_covariance(position_derivatives(belief, targets[:1])[1])
    first = position_derivatives(belief, targets[:1], came[:1])[0]
    for row in range(1, len(sides)):
        ways = np.concatenate([came[[row]], every_side(sides.shape[1])])
        there = targets[np.full(len(ways), row)]
        changes, by_joints = position_derivatives(belief, there, ways)
        changes, scatter = changes - first, noise + belief.noise.record_covariance(by_joints)
        gains = D_OPTIMAL.gain(covariance, changes, scatter)
        best = int(np.argmax(gains))
        if gains[best] >= WORTH_A_MOVE * gains[0]:
            sides[row] = ways[best]
        else:
            best = 0
        covariance = covariance_update(covariance, changes[best], scatter[best])
    return sides


def _held_out(cell: Cell, belief, robot: Robot, seed: int) -> Commands:
    """Random orientations at the points of the verification."""
    own = replace(belief, controller=belief.estimate)
    turns: Array = orientations(HELD_OUT_CANDIDATES, belief.limits.tilt, seed)
    parts, labels = [], []
    for place, point in enumerate(cell.settings.verification.points, start=1):
        position = robot.from_commands([Pose(*point)]).positions[0]
        _, commands = reachable(own, PoseBatch.at(position, np.concatenate([np.eye(3)[None], turns])))
        if len(commands) < HELD_OUT:
            raise UnreachableError("the robot cannot take the held-out poses")
        parts.append(commands[:HELD_OUT])
        labels += [(place, turn) for turn in range(1, HELD_OUT + 1)]
    return Commands(PoseBatch.joined(parts), np.array(labels))
