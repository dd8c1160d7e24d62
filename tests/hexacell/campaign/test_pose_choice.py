"""Poses are chosen where little is known, with margins, and where the robot is elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign import pose_chooser
from hexacell.campaign.decisions import CampaignState, MeasurePose
from hexacell.campaign.feasibility import unreachable_share
from hexacell.campaign.online_estimate import OnlineEstimator
from hexacell.campaign.pose_chooser import FIRST_TURN
from hexacell.design import travel_monte_carlo
from hexacell.design.candidates import ReachableTargets, outcomes_of
from hexacell.design.predicted_records import predict_records
from hexacell.design.travel_monte_carlo import MARGIN_SIGMAS, TravelConstraint
from hexacell.identification.belief import SPARE_ANGLE, SPARE_SIGMAS
from hexacell.identification.estimator import estimate_online
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import free_sensitivity
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.virtual_robot import VirtualRobot, random_robot, robots_within_tolerances
from tests.hexacell.campaign.conftest import Campaign, make

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
    assert not estimate_online(plan.robot.problem(measurements)).termination.converged
    found = OnlineEstimator(plan.robot).estimate(measurements).identification
    assert found is not None
    assert found.termination.converged
    assert found.chi2 < 10.0
    again = OnlineEstimator(plan.robot).estimate(measurements).identification
    assert again is not None
    np.testing.assert_array_equal(found.free, again.free)


@pytest.fixture
def at_points(campaign) -> list:
    """Some decisions on poses of the first point, where much is unknown, and of the second."""
    return [one for one in campaign if isinstance(one.decision, MeasurePose)][1::3]


@pytest.mark.parametrize("is_clear", [False, True])
def test_an_interrupted_run_goes_on_from_the_reference_undisturbed_where_a_line_leads_to_the_last_record(
    two_points, at_points, monkeypatch, is_clear
) -> None:
    """It returned over waypoints that it does not know any more; the set must not be closed for that."""
    if not is_clear:
        monkeypatch.setattr(pose_chooser, "find_route", lambda *_: None)
    for one in at_points:
        state = replace(one.state, present=two_points.reference_pose(one.decision.point))
        decided = two_points.decide(state)
        assert isinstance(decided, MeasurePose), decided
        if is_clear:
            assert decided.pose == one.decision.pose
        else:
            assert decided.orientation == one.decision.orientation
            assert state.present not in decided.via


Choice = tuple[TravelConstraint, ReachableTargets]


def margins(choice: Choice) -> tuple[Array, Array, Array]:
    """What is left by the estimate, its standard deviations, and what the orientation's would ask for."""
    constraint, targets = choice
    belief, zero = constraint.belief, constraint.zero.target
    at = (belief.mechanism, belief.estimate, targets.poses, targets.joints)
    sigmas = belief.margin_sigmas(targets.poses, targets.joints, free_sensitivity(*at))
    turn = SPARE_ANGLE + SPARE_SIGMAS * belief.orientation_sigma(zero.poses, zero.joints)
    return belief.limits.leg_margins(*at)[0], sigmas[0], belief.margins_for(turn)


@pytest.fixture(scope="module")
def chosen(two_points, campaign) -> list[Choice]:
    """Each pose that was chosen when the orientation was no longer uncertain."""
    found = []
    for one in campaign:
        if isinstance(one.decision, MeasurePose):
            estimate = two_points.estimate(one.state)
            constraint = TravelConstraint(estimate.belief, estimate.gauge_zero(one.decision.point))
            commands = two_points.robot.from_commands([one.decision.pose])
            if not constraint.is_uncertain:
                found.append((constraint, outcomes_of(estimate.belief, commands)[0]))
    return found


def test_they_have_five_standard_deviations_left(chosen) -> None:
    assert len(chosen) > 10
    for choice in chosen:
        margin, sigma, by_orientation = margins(choice)
        kept = margin >= np.maximum(MARGIN_SIGMAS * sigma, choice[0].belief.least_margins)
        assert kept.all() or (margin >= by_orientation).all()


def test_a_pose_that_has_less_left_is_refused(chosen, monkeypatch) -> None:
    near = [one for one in chosen if not (margins(one)[0] >= margins(one)[2]).all()]
    assert len(near) > 2
    monkeypatch.setattr(travel_monte_carlo, "MARGIN_SIGMAS", 1e4)
    for constraint, targets in near:
        records = predict_records(constraint.belief, constraint.zero, targets)
        assert not constraint.holds(records).any()


def test_the_first_pose_of_all_turns_hardly(paper, make_plan) -> None:
    """With pilot poses and without."""
    for revisits in (0, 6):
        plan = make_plan(noise__revisits=revisits)
        taken = Campaign(plan, paper.actual).run(most=3)
        state = next(one.state for one in taken if len(one.state.measurements) == 2)
        reference, first = [record.pose for record in state.steering.records][:2]
        assert 0.0 < reference.angle_to(first) <= 1.05 * FIRST_TURN


def with_cones(degrees: float):
    plan = make()
    joints = plan.settings.limits.passive_joints.model_copy(
        update={"base_cone_deg": degrees, "platform_cone_deg": degrees}
    )
    return make(limits__passive_joints=joints, limits__leg_distance_mm=0.0)


@pytest.fixture(scope="module")
def shares():
    return {degrees: unreachable_share(with_cones(degrees)) for degrees in (180.0, 45.0, 30.0)}


def test_without_cones_only_singularities_count(shares) -> None:
    plan = with_cones(180.0)
    references = plan.robot.from_commands([plan.reference_pose(point) for point in plan.points])
    robots = robots_within_tolerances(
        plan.robot, plan.effort.checked_robots, plan.settings.identification.seed
    )
    taken = np.mean([VirtualRobot(plan.robot, truth).can_take(references) for truth in robots], axis=0)
    assert list(shares[180.0].values()) == pytest.approx((1.0 - taken).tolist())


def test_a_joint_beyond_its_cone_makes_a_point_one_that_cannot_be_reached(shares) -> None:
    for point, share in shares[45.0].items():
        assert shares[180.0][point] <= share <= shares[30.0][point]
    assert sum(shares[45.0].values()) > sum(shares[180.0].values())
    assert min(shares[30.0].values()) > 0.0
