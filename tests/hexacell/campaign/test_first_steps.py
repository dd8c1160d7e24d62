"""The first records at a point, when little is known of the robot."""

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState, MeasurePose
from hexacell.campaign.online_estimate import OnlineEstimator
from hexacell.identification.estimator import estimate_online
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.virtual_robot import VirtualRobot, random_robot

TRAVEL_MM = 5.0


@pytest.fixture(scope="module")
def plan(make_plan):
    return make_plan()


def robot_number(plan, number):
    return random_robot(
        plan.robot.mechanism, plan.robot.drawing, plan.robot.tolerances, np.random.default_rng([4, number])
    )


def measured(plan, truth, poses):
    """The records of some poses at the first point, without noise."""
    virtual_robot, records = VirtualRobot(plan.robot, truth, np.random.default_rng(0)), []
    for number, pose in enumerate(poses, start=1):
        virtual_robot.place(pose)
        records.append(virtual_robot.measure(1, number))
    return MeasurementSet(tuple(records))


def test_no_robot_within_the_tolerances_leaves_the_travel_at_its_second_record(plan):
    """With linear propagation, as it is used later, one in forty would."""
    reference = plan.reference_pose(1)
    opened = CampaignState(measured(plan, robot_number(plan, 1), [reference]), 1, present=reference)
    first = plan.decide(opened)
    assert isinstance(first, MeasurePose)
    margin, moved = plan.robot.limits.singularity_margin, []
    for number in range(1, 161):
        virtual_robot = VirtualRobot(plan.robot, robot_number(plan, number))
        commands = plan.robot.from_commands([reference, first.pose])
        if virtual_robot.margins(commands)[0] >= margin:
            assert virtual_robot.can_take(commands).all()
            positions = virtual_robot.actual_poses(commands).poses.positions
            moved.append(np.abs(positions[1] - positions[0]).max())
    assert len(moved) > 110
    assert max(moved) < TRAVEL_MM
    assert np.median(moved) > 0.05  # or it would tell nothing


@pytest.mark.parametrize(
    ("number", "small_turn"),
    [
        (485, Pose(-0.0139, 0.0166, 550.0, -0.26843, -0.1552, -0.49723)),
        (161, Pose(0.0009, -0.1307, 550.0443, -0.29766, -0.29233, -0.10608)),
    ],
)
def test_an_estimate_that_ends_next_to_a_singularity_is_repeated_from_other_starts(
    plan, number, small_turn
):
    """Robots, by number, for which a singularity is between the drawing and both records."""
    measurements = measured(plan, robot_number(plan, number), [plan.reference_pose(1), small_turn])
    assert np.abs(measurements.records[1].deviation).max() > 2.0
    assert not estimate_online(plan.robot.problem(measurements)).converged
    found = OnlineEstimator(plan.robot).estimate(measurements).identification
    assert found is not None
    assert found.converged
    assert found.chi2 < 10.0
    again = OnlineEstimator(plan.robot).estimate(measurements).identification
    assert again is not None
    np.testing.assert_array_equal(found.free, again.free)
