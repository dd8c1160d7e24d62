"""The sides from which joints arrive are chosen for what a record tells of backlash, and only for that."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.forecast import select_sets
from hexacell.design.arrival_sides import with_best_sides
from hexacell.design.candidates import ReachableTargets, commands_for
from hexacell.design.criteria import covariance_update
from hexacell.design.pose_selection import SelectedPose
from hexacell.design.predicted_records import GaugeZero, position_derivatives, predict_records
from hexacell.identification.placement import Weight
from hexacell.identification.solver.term_estimates import TermEstimates
from hexacell.identification.terms.backlash import backlash
from hexacell.identification.terms.play import play
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion.paths import PathPlanner
from hexacell.robot.model import robot_of

BACK = 0.45
POSES = 7


@pytest.fixture(scope="module")
def robot(bundled_cell):
    return robot_of(bundled_cell)


def with_terms(robot, *terms):
    """A robot that is as drawn, which is known to a tenth of the tolerances."""
    belief, free = robot.belief(), robot.free_parameters
    known = replace(belief, covariance=0.01 * belief.covariance)
    return replace(known, terms=TermEstimates.expected(terms, len(free)) if terms else None)


@pytest.fixture(scope="module")
def sets(robot, bundled_cell):
    """Poses at three points, selected as they come for a robot with backlash."""
    points = robot.from_commands(Pose(*one) for one in bundled_cell.settings.identification.points[:3])
    return select_sets(with_terms(robot, backlash(0.1)), points.positions, POSES, 1, 64)


def measured(belief, sets, back=BACK):
    """What is known after the records of some sets, and how each pose was reached."""
    chosen = []
    for poses in sets:
        targets = ReachableTargets(poses, belief.mechanism.inverse(belief.estimate, belief.branch, poses))
        commands, _ = commands_for(belief, targets)
        own, by_joints = position_derivatives(belief, targets[[0]], np.ones((1, 6)))
        noise = belief.noise.record_covariance(by_joints)[0]
        zero = GaugeZero(
            poses.positions[0], poses.rotations[0], targets.joints[0], own[0], noise, targets.joints[0]
        )
        for row in range(1, len(poses)):
            zero = replace(zero, before=targets.joints[row - 1])
            record = predict_records(belief, zero, targets[[row]])
            one = SelectedPose(commands.pose(row), record, 1.0, ())
            planner = PathPlanner(belief, commands[[row - 1]], None, zero.reference)
            one = with_best_sides(planner, zero, one, back)
            known = covariance_update(
                belief.joint_covariance, one.record.jacobian[0], one.record.covariance[0]
            )
            belief = belief.knowing(known)
            chosen.append(one)
    return belief, chosen


def test_as_many_records_tell_more_of_backlash_by_sides_that_are_chosen(robot, sets):
    belief = with_terms(robot, backlash(0.1))
    (as_they_come, straight), (by_choice, chosen) = (measured(belief, sets, back) for back in (0.0, BACK))
    assert not any(one.waypoints for one in straight)
    (_, come), (_, sigma) = (one.terms.of("backlash") for one in (as_they_come, by_choice))
    assert np.sqrt(np.mean(sigma**2)) < 0.9 * np.sqrt(np.mean(come**2))
    assert np.trace(by_choice.covariance) < 1.02 * np.trace(as_they_come.covariance), "nor is geometry less"
    over = [one for one in chosen if one.waypoints]
    assert 0.2 * len(chosen) < len(over) < len(chosen), "a waypoint only where it gains"
    for one in over:
        (waypoint,) = one.waypoints
        ways = np.subtract(*(belief.commanded.joints(PoseBatch.of([p])) for p in (one.command, waypoint)))
        assert np.abs(ways) == pytest.approx(np.full((1, 6), BACK), abs=1e-9)


def test_where_no_backlash_is_looked_for_every_pose_is_reached_straight(robot, sets):
    down = play(0.1, Weight(np.array([0.0, 0.0, -1.0])))
    for belief in (with_terms(robot), with_terms(robot, down)):
        _, chosen = measured(belief, sets[:1])
        assert not any(one.waypoints for one in chosen)
