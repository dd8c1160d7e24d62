"""Forecasts of a plan against the estimator, campaigns and dry runs on virtual robots."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.forecast import PlannedInformation
from hexacell.campaign.task_accuracy import planned_budget
from hexacell.campaign.time_model import TimeKind, TimeModel, seconds_beside
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.config.interface import ControllerGeometry
from hexacell.design.criteria import add_information
from hexacell.dry_run.campaign import VirtualCampaign, dry_run
from hexacell.identification.diagnostics.pose_accuracy import predicted_accuracy
from hexacell.identification.estimator import estimate_online
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.motion.durations import line_durations
from hexacell.robot.model import make_robot
from hexacell.robot.stated import stated_effects
from hexacell.robot.virtual_robot import VirtualRobot, exact_records, robots_within_tolerances
from tests.geometries import hexaglide_geometry
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


THREE_POINTS = ((0.0, -200.0, 550.0), (100.0, -100.0, 500.0), (-100.0, 100.0, 500.0))


@pytest.fixture(scope="module")
def ordinary(make_plan):
    """The plan of a machine with the effects of an ordinary one."""
    plan = make_plan(identification__points=THREE_POINTS)
    uncertainty = UncertaintySettings(grade="ordinary")
    settings = plan.settings.model_copy(update={"uncertainty": uncertainty})
    return replace(plan, settings=settings, robot=plan.robot.with_errors_of(settings))


def test_exact_records_are_those_of_a_virtual_robot_without_errors_and_noise(make_plan) -> None:
    robot = make_plan().robot
    silent = replace(robot, noise=replace(robot.noise, encoder=0.0, gauge_mm=0.0, stops=0.0))
    tilted = [Pose(101.0, -100.0, 499.0, 5.0, -8.0, 12.0), Pose(99.0, -98.0, 503.0, -6.0, 5.0, -14.0)]
    commands = [Pose(100.0, -100.0, 500.0), *tilted]
    virtual = VirtualRobot(silent, robot.commanding)
    measured = []
    for orientation, command in enumerate(commands, start=1):
        virtual.place(command)
        measured.append(virtual.measure(2, orientation))
    found = [*exact_records(robot, 2, robot.from_commands(commands))]
    assert [one.id for one in found] == [(2, 1), (2, 2), (2, 3)]
    for one, expected in zip(found, measured, strict=True):
        assert one.pose.as_tuple() == pytest.approx(expected.pose.as_tuple(), abs=1e-9)
        assert one.joints == pytest.approx(expected.joints, abs=1e-6)
        assert one.deviation == pytest.approx(expected.deviation, abs=1e-6)
    ways, directions = np.diff([one.joints for one in found], axis=0), [one.directions for one in found]
    assert directions[0] == (0,) * 6
    sure = np.abs(ways) > 0.3
    np.testing.assert_array_equal(np.array(directions[1:])[sure], np.sign(ways)[sure])
    assert sure.mean() > 0.8


def test_it_is_that_of_a_campaign_that_was_carried_out(ordinary, paper) -> None:
    """The planned poses are not those that are chosen, so that it is only about the same."""
    campaign = VirtualCampaign(
        ordinary, VirtualRobot(ordinary.robot, paper.actual, np.random.default_rng(2))
    )
    campaign.carry_out()
    estimate = ordinary.estimate(campaign.state)
    budget = ordinary.task.budget(estimate.identification, estimate.belief, ordinary.robot.effects)
    assert ordinary.systematic_mm == pytest.approx(budget.systematic_mm, rel=0.4)
    forecast = ordinary.forecast(campaign.state)
    assert forecast.systematic_mm == ordinary.systematic_mm
    expanded = 2.0 * np.hypot(forecast.now_mm, ordinary.systematic_mm)
    assert forecast.expanded_mm(forecast.now_mm) == pytest.approx(expanded)
    assert forecast.expanded_mm(forecast.now_mm) == pytest.approx(budget.expanded_mm, rel=0.4)


def test_an_earlier_result_shares_its_constant_effects(ordinary) -> None:
    """A prior that had the effects as well, and is much better known than the records make it."""
    sets, task = ordinary.planned_sets, ordinary.task
    alone = planned_budget(ordinary.robot, task, sets)
    known = replace(ordinary.robot.prior, covariance=1e-6 * ordinary.robot.prior.covariance)
    robot = replace(ordinary.robot, known=known)
    zero = np.zeros((35, 6))
    unaware = planned_budget(robot, task, sets, {"scale of each encoder": zero})
    aware = planned_budget(robot, task, sets, {"scale of each encoder": zero + 1e-3})
    assert alone is not None
    assert unaware is not None
    assert aware is not None
    assert aware.systematic_mm != pytest.approx(unaware.systematic_mm, rel=0.01)


def test_a_task_that_nobody_reaches_has_no_uncertainty(ordinary) -> None:
    far = replace(ordinary.task, poses=ordinary.robot.from_commands([Pose(0.0, 0.0, 5000.0)]))
    assert planned_budget(ordinary.robot, far, ordinary.planned_sets) is None


SEED = {"identification__seed": 2}  # whose first robot can be measured


@pytest.fixture(scope="module")
def result():
    return dry_run(at_two_points(**SEED))


def test_the_result_is_that_of_a_campaign(result, campaign, two_points):
    outlook = two_points.forecast(campaign[-1].state)
    assert result.robots == 1
    assert result.points == 2
    assert 12 <= result.records <= 16
    assert result.outside == 0
    assert outlook.now_mm / 4.0 < result.worst_sigma_mm < 4.0 * outlook.now_mm


def test_systematic_effects_widen_the_expanded_uncertainty(result):
    plan = at_two_points(**SEED)
    stated = plan.settings.model_copy(update={"uncertainty": UncertaintySettings(grade="ordinary")})
    machine = replace(plan.robot, effects=stated_effects(stated))
    wider = dry_run(replace(plan, settings=stated, robot=machine))
    assert wider.records == result.records
    assert wider.worst_sigma_mm == result.worst_sigma_mm < result.expanded_mm < wider.expanded_mm


def test_minutes_are_of_everything_that_is_measured(result):
    plan = at_two_points(**SEED)
    beside, least = seconds_beside(plan.settings), result.records * plan.settings.timing.window_s
    assert result.seconds[TimeKind.READING] >= beside[TimeKind.READING] + least
    assert result.seconds[TimeKind.MOVING] > beside[TimeKind.MOVING]
    assert result.seconds[TimeKind.PLACING] == 0.0
    assert result.minutes == pytest.approx(sum(result.seconds.values()) / 60.0)
    by_hand = dry_run(at_two_points(**SEED, stations__placement="by-hand"))
    placing_s = by_hand.seconds[TimeKind.PLACING]
    assert placing_s == (2 + 2 * 3) * 60.0 * plan.settings.identification.minutes_per_station


def test_wide_moves_take_what_their_lines_do():
    plan = at_two_points(**SEED)
    times, robot = TimeModel.of(plan.settings), plan.robot
    ball = robot.from_commands([plan.reference_pose(1)]).positions[0]
    tilted = rotations.from_vector(np.radians([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0]]))
    poses = PoseBatch.at(ball, tilted)
    wide = times.between_held_out(robot, [poses])
    geometry = robot.mechanism, robot.commanding, robot.branch
    line_s = line_durations(*geometry, poses[:1], poses[1:], times.speeds)[0]
    assert wide.wide_move_s == pytest.approx(times.overheads.move_s + line_s, rel=0.05)
    assert wide.station_s - times.station_s == pytest.approx(wide.wide_move_s - times.wide_move_s)


def test_the_course_is_what_fewer_minutes_would_have_given(result):
    minutes, errors = zip(*result.course, strict=True)
    assert list(minutes) == sorted(minutes)
    assert minutes[-1] < result.minutes < 1.1 * minutes[-1]
    assert errors[0] > 3.0 * errors[-1]
    assert result.expanded_mm == pytest.approx(errors[-1], rel=0.5)


def test_robots_that_cannot_be_measured_do_not_count():
    plan = at_two_points(**SEED, tolerances__S_mm=200.0)
    found = dry_run(plan)
    assert found.robots == 0
    assert found.drawn == 6
    assert found.worst_sigma_mm is None


def test_a_robot_calibrated_before_is_near_what_its_controller_has(make_plan, paper):
    plan = make_plan()
    controller = hexaglide_geometry(paper.actual["S"], paper.actual["B"], paper.actual["l"])
    robot = make_robot(plan.settings, ControllerGeometry(controller, paper.branch))
    centre = robot.belief().controller.vector
    drawn = robots_within_tolerances(robot, 16, seed=3)
    lengths = np.array([one.vector - centre for one in drawn])[:, -6:]
    assert 0.5 < np.abs(lengths).max() <= 0.7
