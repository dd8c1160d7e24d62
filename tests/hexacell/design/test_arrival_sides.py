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


@pytest.fixture(scope="module")
def known(bundled_cell):
    """A robot as drawn, known to a tenth of the tolerances, with backlash; and poses as they come."""
    robot, points = robot_of(bundled_cell), bundled_cell.settings.identification.points[:3]
    terms = TermEstimates.expected((backlash(0.1),), len(robot.free_parameters))
    belief = replace(robot.belief(), covariance=0.01 * robot.belief().covariance, terms=terms)
    return belief, select_sets(
        belief, robot.from_commands(Pose(*one) for one in points).positions, 7, 1, 64
    )


def measured(belief, sets, back):
    """What is known after the records of some sets, and how each pose was reached."""
    chosen = []
    for poses in sets:
        targets = ReachableTargets(poses, belief.mechanism.inverse(belief.estimate, belief.branch, poses))
        commands, first = commands_for(belief, targets)[0], targets[[0]]
        own, by_joints = position_derivatives(belief, first, np.ones((1, 6)))
        noise, place = belief.noise.record_covariance(by_joints)[0], poses.positions[0]
        for row in range(1, len(poses)):
            before = targets.joints[row - 1]
            zero = GaugeZero(place, poses.rotations[0], first.joints[0], own[0], noise, before)
            planner = PathPlanner(belief, commands[[row - 1]], None, place)
            record = predict_records(belief, zero, targets[[row]])
            straight = SelectedPose(commands.pose(row), record, 1.0, ())
            chosen.append(with_best_sides(planner, zero, straight, back))
            shown = chosen[-1].record.jacobian[0], chosen[-1].record.covariance[0]
            belief = belief.knowing(covariance_update(belief.joint_covariance, *shown))
    return belief, chosen


def test_as_many_records_tell_more_of_backlash_by_sides_that_are_chosen(known):
    belief, sets = known
    (as_they_come, straight), (by_choice, chosen) = (measured(belief, sets, back) for back in (0.0, BACK))
    assert not any(one.waypoints for one in straight)
    (_, come), (_, sigma) = (one.terms.of("backlash") for one in (as_they_come, by_choice))
    assert np.sqrt(np.mean(sigma**2)) < 0.9 * np.sqrt(np.mean(come**2))
    assert np.trace(by_choice.covariance) < 1.02 * np.trace(as_they_come.covariance), "nor is geometry less"
    over = [one for one in chosen if one.waypoints]
    assert 0.2 * len(chosen) < len(over) < len(chosen), "a waypoint only where it gains"
    for one in over:
        ends = (PoseBatch.of([pose]) for pose in (one.command, *one.waypoints))
        ways = np.subtract(*map(belief.commanded.joints, ends))
        assert np.abs(ways) == pytest.approx(np.full((1, 6), BACK), abs=1e-9)


def test_where_no_backlash_is_looked_for_every_pose_is_reached_straight(known):
    belief, sets = known
    clearance = play(0.1, Weight(np.array([0.0, 0.0, -1.0])))
    for terms in (None, TermEstimates.expected((clearance,), len(belief.free))):
        assert not any(one.waypoints for one in measured(replace(belief, terms=terms), sets[:1], BACK)[1])
