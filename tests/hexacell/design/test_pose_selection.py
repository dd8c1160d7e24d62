"""The pose measured next: informative, and inside the travel for any robot that the estimate allows."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.design import pose_selection
from hexacell.design.candidate_refinement import THOROUGH
from hexacell.design.candidates import orientations
from hexacell.design.criteria import covariance_update
from hexacell.design.pose_selection import WAYPOINT_GAIN_RATIO, select_pose
from hexacell.design.predicted_records import (
    SAFETY_SIGMAS,
    TRAVEL_SHARE,
    estimate_gauge_zero,
    gauge_zero_at,
)
from hexacell.errors import ExitCode, LimitError
from hexacell.identification.estimator import estimate_online
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.motion.paths import PathPlanner
from tests.hexacell.conftest import reached, vector

TRAVEL_MM = 5.0
TILT = float(np.radians(45.0))
TURNS = orientations(256, TILT, seed=11)


def station_of(know, estimate, point):
    return gauge_zero_at(know(estimate), estimate, point)


def selected(belief, zero, turns, start=None, rounds=THOROUGH):
    """The pose selected with paths from the reference, or from another command."""
    start = zero.command(belief) if start is None else start
    return select_pose(PathPlanner(belief, start, None, zero.reference), zero, turns, rounds=rounds)


@pytest.fixture(scope="module", params=["little", "much"])
def stage(request, know):
    """An estimate, the gauges' zero at the first point, and the pose selected there."""
    estimate = request.getfixturevalue(request.param)
    at = station_of(know, estimate, 1)
    return estimate, at, selected(know(estimate), at, TURNS)


def stands(legs, geometry, joints, near):
    """The pose (position and rotation vector) at some joint variables, by the test's root finder."""
    pose = legs(geometry).closed(joints, near)
    assert pose is not None
    return pose


def aimed_at(legs, estimate, choice, at):
    start = vector(Pose.of(at.reference, choice.command.rotation))
    return stands(legs, estimate.geometry, choice.record.targets.joints[0], start)


def test_the_prediction_keeps_the_travel_with_three_sigma(stage):
    _, _, choice = stage
    deviation, sigma = choice.record.deviation[0], choice.record.sigma[0]
    assert (np.abs(deviation) + SAFETY_SIGMAS * sigma <= TRAVEL_SHARE * TRAVEL_MM).all()
    assert (sigma > 0.0).all()
    assert TRAVEL_SHARE < 1.0
    assert SAFETY_SIGMAS >= 3.0


def test_the_estimated_robot_brings_the_ball_to_the_expected_deviation(stage, legs):
    """From the estimated reference, which is millimetres from the nominal point."""
    estimate, at, choice = stage
    pose = aimed_at(legs, estimate, choice, at)
    np.testing.assert_allclose(pose[:3], at.reference + choice.record.deviation[0], atol=1e-6)
    assert np.linalg.norm(at.reference - [0.0, 0.0, 550.0]) > 0.5


def test_the_ball_of_every_likely_robot_stays_inside_the_travel(stage, legs, hexaglide):
    """Robots sampled from the estimate, each moved from its own reference to the pose."""
    estimate, at, choice = stage
    random = np.random.default_rng(0)
    robots = random.multivariate_normal(estimate.free, estimate.free_covariance, size=120)
    problem = estimate.problem
    assert problem.labels[0].tolist() == [1, 1]
    from_where = vector(estimate.poses.pose(0))
    goes_to = aimed_at(legs, estimate, choice, at)
    deviations = []
    for free in robots:
        robot = hexaglide.convention.geometry(free)
        reference = stands(legs, robot, problem.joints[0], from_where)
        deviations.append(stands(legs, robot, choice.record.targets.joints[0], goes_to)[:3] - reference[:3])
    spread = np.std(deviations, axis=0)
    assert (np.abs(deviations) < TRAVEL_MM).all()
    # The prediction also knows the noise, and of the reference what all its records say.
    assert (spread < 1.5 * choice.record.sigma[0] + 0.02).all()


def test_the_gain_is_the_reduction_of_entropy_by_the_record(stage, know, paper, make_problem, noisy, visit):
    """The entropy of the estimate with the record is lower by about the predicted gain."""
    estimate, _, choice = stage
    joints, pose = reached(paper.actual, paper.nominal, choice.command)
    few = visit(points=1, orientations=4, degrees=2.0, seed=5)
    many = visit(seed=2)
    exact, measured = (few, few.measured(0.01, 5)) if estimate.records == 4 else (many, noisy)
    seen = pose[:3] - exact.balls[0]
    record = Record(1, 99, choice.command, tuple(joints.tolist()), tuple(seen.tolist()))
    after = estimate_online(make_problem(MeasurementSet((*measured.records, record))))

    def entropy(covariance):
        return 0.5 * np.linalg.slogdet(covariance)[1]

    fallen = entropy(estimate.free_covariance) - entropy(after.free_covariance)
    assert choice.gain > 0.0
    assert fallen == pytest.approx(choice.gain, rel=0.3, abs=0.2)


def test_a_record_like_one_that_is_planned_is_not_selected(know, much):
    belief, at = know(much), station_of(know, much, 1)
    first = selected(belief, at, TURNS)
    record = first.record
    then = covariance_update(belief.covariance, record.jacobian[0], record.covariance[0] / 8.0)
    planner = PathPlanner(belief, at.command(belief), None, at.reference)
    second = select_pose(planner, at, TURNS, known_then=then)
    turn = Rotation.from_matrix(second.command.rotation @ first.command.rotation.T)
    assert np.degrees(turn.magnitude()) > 15.0
    assert second.gain < first.gain  # beside what is known now


@pytest.mark.parametrize("present", [0, 2])
def test_the_path_from_the_present_pose_is_clear_and_inside_the_travel(know, much, paper, legs, present):
    """From a pose of the first point, over the waypoints, sampled more finely than in the selection."""
    at = station_of(know, much, 1)
    start = much.problem.commands.poses[[present]]
    choice = selected(know(much), at, TURNS, start)
    line = [np.array(pose.as_tuple()) for pose in (start.pose(0), *choice.waypoints, choice.command)]
    near = vector(much.poses.pose(present))
    for begin, end in pairwise(line):
        for share in np.linspace(0.0, 1.0, 40):
            command = vector(Pose(*((1.0 - share) * begin + share * end).tolist()))
            joints = legs(paper.nominal).joints(command)
            near = stands(legs, much.geometry, joints, near)
            assert np.abs(joints).max() <= 800.0
            assert legs(paper.nominal).margin(joints, command) > 0.024
            assert legs(much.geometry).margin(joints, near) > 0.024
            assert np.abs(near[:3] - at.reference).max() < TRAVEL_MM + 0.1


def test_an_orientation_without_a_clear_path_is_not_selected(know, much):
    """From beyond a singularity no path leads back: nothing is left to select."""
    at = station_of(know, much, 1)
    beyond = PoseBatch.of([Pose(0, 0, 550, 0, 0, 100)])
    with pytest.raises(LimitError, match="inside the gauges' travel"):
        selected(know(much), at, TURNS, beyond)


def test_waypoints_are_taken_only_for_enough_gain(know, much, monkeypatch):
    """From a tilted pose: the selected orientation depends on what waypoints cost."""
    at, start = station_of(know, much, 1), much.problem.commands.poses[[2]]
    for name, size in (("PATH_BATCH", 64), ("COMMAND_BATCHES", (64,))):
        monkeypatch.setattr(pose_selection, name, size)  # so many that a straight line leads to one

    def chosen(least):
        monkeypatch.setattr(pose_selection, "WAYPOINT_GAIN_RATIO", least)
        return selected(know(much), at, TURNS, start)

    free, dear, usual = chosen(1.0), chosen(100.0), chosen(WAYPOINT_GAIN_RATIO)
    assert free.waypoints
    assert not dear.waypoints
    assert free.gain > dear.gain
    assert usual.gain >= (WAYPOINT_GAIN_RATIO if usual.waypoints else 1.0) * dear.gain


def test_the_jacobian_of_the_record_is_that_of_the_forward_kinematics(stage, legs, hexaglide):
    """By central differences of the test's own forward kinematics."""
    estimate, at, choice = stage
    goes_to = aimed_at(legs, estimate, choice, at)

    def ball(free):
        geometry = hexaglide.convention.geometry(free)
        return stands(legs, geometry, choice.record.targets.joints[0], goes_to)[:3]

    steps = 1e-3 * np.eye(len(estimate.free))
    moved = [(ball(estimate.free + step) - ball(estimate.free - step)) / 2e-3 for step in steps]
    np.testing.assert_allclose(choice.record.jacobian[0], np.transpose(moved) - at.jacobian, atol=1e-4)
    by_encoders = choice.record.covariance[0] - at.covariance - 0.01**2 * np.eye(3)
    assert (np.linalg.eigvalsh(by_encoders) > 0.0).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tilt": 1e-6}, "no orientation is within reach"),
        ({"gauge_travel_mm": 1e-3}, "no orientation surely keeps the ball inside"),
    ],
)
def test_without_a_safe_pose_the_error_gives_the_reason(know, much, limits, change, message):
    at = station_of(know, much, 1)
    belief = replace(know(much), limits=replace(limits, **change))
    with pytest.raises(LimitError, match=message) as caught:
        selected(belief, at, TURNS)
    assert caught.value.exit_code is ExitCode.OUT_OF_LIMITS


def test_the_estimated_zero_is_the_position_of_the_ball_when_zeroed(know, paper, visit):
    """With exact records and the true geometry every record gives the same position."""
    exact = visit(seed=2)
    rows = slice(11, 22)
    measured = exact.measured()
    at = estimate_gauge_zero(
        know(paper.actual),
        PoseBatch(exact.balls[rows], exact.rotations[rows]),
        exact.joints[rows],
        measured.deviations[rows],
    )
    np.testing.assert_allclose(at.reference, exact.balls[11], atol=1e-9)
    np.testing.assert_allclose(at.orientation, exact.rotations[11])


def test_the_jacobian_of_the_zero_is_that_of_the_forward_kinematics(know, paper, legs, visit, hexaglide):
    exact, rows = visit(seed=2), slice(0, 4)
    deviations = exact.measured().deviations[rows]

    def at(free):
        geometry = hexaglide.convention.geometry(free)
        near = np.hstack([exact.balls[rows], Rotation.from_matrix(exact.rotations[rows]).as_rotvec()])
        found = np.array(
            [stands(legs, geometry, q, pose) for q, pose in zip(exact.joints[rows], near, strict=True)]
        )
        poses = PoseBatch(found[:, :3], Rotation.from_rotvec(found[:, 3:]).as_matrix())
        return estimate_gauge_zero(know(paper.actual), poses, exact.joints[rows], deviations)

    free = hexaglide.convention.free_parameters(paper.actual)
    jacobian = at(free).jacobian
    # The weights are held at the given geometry, as they are in the estimate.
    for n in range(0, 35, 4):
        step = 1e-3 * np.eye(35)[n]
        moved = (at(free + step).reference - at(free - step).reference) / 2e-3
        np.testing.assert_allclose(jacobian[:, n], moved, atol=2e-2 * max(1.0, np.abs(moved).max()))
