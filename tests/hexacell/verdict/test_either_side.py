"""Legs that may lie on either side of their play: by the balance of the simulated machine."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.simulated.imperfections import LoadedMachine
from hexacell.campaign.task_accuracy import Task
from hexacell.identification.belief import RobotBelief
from hexacell.identification.placement import Weight
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.identification.terms.corrected_joints import commanded_joints
from hexacell.identification.terms.play import play
from hexacell.kinematics import rotations
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.pose import PoseBatch
from hexacell.robot.model import Robot, robot_of
from hexacell.verdict.either_side import places_on_either_side
from tests.benchmarks.machines import bundled, truth_of

PLAY_MM, CENTRE_MM, DOWN = 0.2, (5.0, -3.0, 20.0), np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def robot() -> Robot:
    return robot_of(bundled())


@pytest.fixture(scope="module")
def belief(robot: Robot) -> RobotBelief:
    truth, frames = truth_of(bundled(), robot, 0), robot.mechanism.normalize_frames(robot.drawing)[1]
    down = frames.base @ DOWN
    loose = play(0.1, Weight(down, np.array(CENTRE_MM)))
    term = replace(loose, mean=np.full(6, PLAY_MM), sigma=np.full(6, 0.01))
    free = robot.mechanism.convention.free_parameters(truth)
    return replace(robot.belief(), free=free, terms=TermEstimates.expected((term,), len(free)))


@pytest.fixture(scope="module")
def task(robot: Robot, belief: RobotBelief) -> Task:
    return Task.of(bundled().settings, robot, belief)


def farthest_place_mm(belief: RobotBelief, robot: Robot, pose: PoseBatch) -> float:
    """How far from its commanded pose the simulated machine comes to rest, from starts about it."""
    stated = bundled().settings.simulation
    assert stated is not None
    down = tuple(robot.mechanism.normalize_frames(robot.drawing)[1].base @ DOWN)
    load = stated.load.model_copy(
        update={"weight_n": 100.0, "centre_mm": CENTRE_MM, "direction": tuple(map(float, down))}
    )
    legs = stated.legs.model_copy(update={"play_mm": (PLAY_MM,) * 6})
    yielding = stated.model_copy(update={"load": load, "legs": legs})
    corrections = Corrections(
        play_mm=(PLAY_MM,) * 6, weight_n=100.0, weight_direction=load.direction, weight_centre_mm=CENTRE_MM
    )
    joints, _ = commanded_joints(belief.mechanism, belief.estimate, belief.branch, corrections, pose)
    random, farthest = np.random.default_rng(5), 0.0
    for _ in range(8):
        machine = LoadedMachine(belief.mechanism, belief.estimate, yielding)
        turned = rotations.from_vector(0.004 * random.standard_normal(3)) @ pose.rotations
        start = PoseBatch(pose.positions + 0.7 * random.standard_normal(3), turned)
        found = machine.pose(joints[0], 0.0, start)
        assert found.found[0]
        farthest = max(farthest, float(np.linalg.norm(found.poses.positions - pose.positions)))
    return farthest


def test_only_where_a_machine_has_another_place_and_as_far_as_that(robot, belief, task) -> None:
    named = places_on_either_side(robot, belief, task)
    [pose] = {one.pose for one in named}
    for row in range(len(task.poses)):
        is_named = robot.to_command(task.poses.pose(row)).as_tuple() == pose
        farthest = farthest_place_mm(belief, robot, task.poses[row : row + 1])
        expected = max(one.apart_mm for one in named) if is_named else 0.0
        assert farthest == pytest.approx(expected, rel=0.02, abs=1e-3)
    assert {5} < {leg for one in named for leg in one.legs}, "that hardly anything loads"
    assert not places_on_either_side(robot, replace(belief, terms=None), task), "nothing without play"
