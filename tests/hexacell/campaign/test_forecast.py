"""Information of planned sets and error at the task poses, compared with the estimator."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.forecast import PlannedInformation
from hexacell.design.criteria import add_information
from hexacell.identification.diagnostics.pose_accuracy import predicted_accuracy
from hexacell.identification.estimator import estimate_online
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.robot.virtual_robot import VirtualRobot
from tests.hexacell.campaign.conftest import TWO_POINTS, at_two_points


@pytest.fixture(scope="module")
def plan():
    return at_two_points(stations__alignment_deg=0.0, noise__gauge_scale=0.0)


def test_the_information_of_sets_is_that_of_the_estimator(plan):
    """The records of a robot as drawn at the sets give the predicted covariance."""
    belief = plan.robot.belief()
    virtual_robot = VirtualRobot(plan.robot, belief.estimate, np.random.default_rng(0))
    records = []
    for point, poses in enumerate(plan.planned_sets, start=1):
        virtual_robot.zero_gauges()
        for row in range(len(poses)):
            virtual_robot.place(plan.robot.to_command(poses.pose(row)))
            records.append(virtual_robot.measure(point, row + 1))
    found = estimate_online(plan.robot.problem(MeasurementSet(tuple(records))))
    seen = PlannedInformation.of(plan.planned_sets, belief)
    predicted = add_information(belief.covariance, seen.information(1, 8) + seen.information(2, 8))
    np.testing.assert_allclose(
        np.sqrt(np.diag(found.free_covariance)), np.sqrt(np.diag(predicted)), rtol=0.02
    )


def test_information_grows_with_the_records_from_the_second_on(plan):
    seen = PlannedInformation.of(plan.planned_sets, plan.robot.belief())
    traces = [np.trace(seen.information(1, count)) for count in range(9)]
    assert traces[0] == traces[1] == 0.0
    assert (np.diff(traces[1:]) > 0.0).all()
    np.testing.assert_array_equal(seen.information(1, 99), seen.information(1, 8))
    assert np.linalg.eigvalsh(seen.information(2, 8)).min() > -1e-6 * traces[-1]


def test_sets_begin_at_the_level_point_and_keep_the_limits(plan):
    for point, poses in zip(TWO_POINTS, plan.planned_sets, strict=True):
        assert len(poses) == 8
        np.testing.assert_allclose(poses.rotations[0], np.eye(3), atol=1e-12)
        np.testing.assert_allclose(poses.positions, np.broadcast_to(point, (8, 3)), atol=1e-9)
        assert poses.tilts().max() <= plan.robot.limits.tilt + 1e-9


def test_a_point_that_cannot_be_reached_has_no_set(make_plan):
    plan = make_plan(identification__points=(TWO_POINTS[0], (0.0, 0.0, 1500.0)))
    assert len(plan.planned_sets[1]) == 0
    seen = PlannedInformation.of(plan.planned_sets, plan.robot.belief())
    assert not seen.information(2, 8).any()


def test_the_error_at_the_task_is_that_of_the_assessment(campaign, two_points):
    state = campaign[-1].state
    known = two_points.estimate(state)
    accuracy = predicted_accuracy(
        known.belief, task=two_points.task.poses, workspace=two_points.task.workspace
    )
    assert accuracy is not None
    assert accuracy.reachable.all()
    outlook = two_points.forecast(state)
    assert outlook is not None
    assert outlook.now_mm == pytest.approx(accuracy.after.position_largest_mm, rel=0.02)


def test_without_reachable_task_poses_there_is_no_forecast(make_plan, campaign):
    plan = make_plan(task__poses=((0.0, 0.0, 3000.0, 0.0, 0.0, 0.0),), identification__points=TWO_POINTS)
    assert plan.forecast(CampaignState()) is None
    visit = plan.decide(campaign[3].state)
    assert visit.forecast is None
    assert visit.gain > 0.0


def test_what_is_known_beside_the_next_record_is_all_that_is_planned_without_it(plan):
    """At the reference of the first point: six more there beside the next one, and eight at the second."""
    belief, pose = plan.robot.belief(), plan.reference_pose(1)
    record = Record(1, 1, pose, (0.0,) * 6, (0.0, 0.0, 0.0))
    state = CampaignState(MeasurementSet((record,)), point=1, present=pose)
    seen = PlannedInformation.of(plan.planned_sets, belief)
    planned = add_information(belief.covariance, seen.information(1, 7) + seen.information(2, 8))
    known = plan.forecaster.known_beside_next(belief, state)
    np.testing.assert_allclose(known, planned, rtol=1e-9, atol=1e-12)
    # The second point's records go to the first, of which one is left.
    taken = MeasurementSet(tuple(replace(record, orientation=row) for row in range(1, 16)))
    at_end = replace(state, measurements=taken, done=frozenset({2}))
    np.testing.assert_array_equal(plan.forecaster.known_beside_next(belief, at_end), belief.covariance)
