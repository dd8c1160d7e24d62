"""Candidate orientations: what a record is worth, refinement, and sampled robots for the travel."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.design import travel_monte_carlo
from hexacell.design.candidate_refinement import QUICK, THOROUGH, CandidateSpace, RatedRecords, Rounds
from hexacell.design.candidates import (
    Amplitudes,
    orientations,
    reachable,
    reachable_targets,
    rows_apart,
    workspace_poses,
)
from hexacell.design.criteria import D_OPTIMAL, Criterion, covariance_update
from hexacell.design.predicted_records import SAFETY_SIGMAS, TRAVEL_SHARE, gauge_zero_at, predict_records
from hexacell.design.travel_monte_carlo import TravelConstraint
from hexacell.kinematics.pose import FrameTransform, Pose, PoseBatch
from tests.hexacell.conftest import vector

TILT = float(np.radians(45.0))


def as_vectors(poses: PoseBatch) -> np.ndarray:
    return np.hstack([poses.positions, Rotation.from_matrix(poses.rotations).as_rotvec()])


@pytest.mark.parametrize("tilt", [0.05, 0.3, TILT])
def test_orientations_are_rotations_over_the_whole_range_of_tilts(tilt):
    turns = orientations(256, tilt, seed=1)
    np.testing.assert_allclose(
        turns @ np.swapaxes(turns, -1, -2), np.eye(3)[None].repeat(256, 0), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1.0)
    tilts = np.arccos(np.clip(turns[:, 2, 2], -1.0, 1.0))
    assert tilts.max() <= tilt + 1e-9
    # Small ones for the beginning, large ones for later, and tilts to every side.
    assert (tilts < 0.1 * tilt).sum() >= 20
    assert (tilts > 0.8 * tilt).sum() >= 20
    headings = np.arctan2(turns[:, 1, 2], turns[:, 0, 2])
    assert np.histogram(headings, bins=8, range=(-np.pi, np.pi))[0].min() >= 16


@pytest.fixture(scope="module")
def found(know, much):
    """Candidates at the first point once the robot is known."""
    return reachable(know(much), PoseBatch.at([0.0, 0.0, 550.0], orientations(256, TILT, seed=3)))


def test_candidates_are_poses_of_the_estimated_robot(found, much, legs):
    targets, _ = found
    assert len(targets) > 100
    estimated = legs(much.geometry)
    for target, joints in zip(as_vectors(targets.poses), targets.joints, strict=True):
        assert np.abs(estimated.errors(target, joints)).max() < 1e-9


def test_inverse_kinematics_of_the_commands_gives_the_joints(found, paper, legs):
    targets, commands = found
    controller = legs(paper.nominal)
    for row, joints in enumerate(targets.joints):
        command = vector(commands.pose(row))  # as it is sent: six numbers
        np.testing.assert_allclose(controller.joints(command), joints, atol=1e-6)


def test_candidates_keep_the_singularity_margin_of_both_geometries(found, much, paper, legs):
    targets, commands = found
    for poses, geometry in ((targets.poses, much.geometry), (commands, paper.nominal)):
        for pose, joints in zip(as_vectors(poses), targets.joints, strict=True):
            assert legs(geometry).margin(joints, pose) > 0.05 - 1e-4


def test_some_poses_of_the_estimated_robot_have_no_command(know, much):
    """Poses that the uncalibrated controller cannot command are left out."""
    poses = PoseBatch.at([0.0, 0.0, 550.0], orientations(256, TILT, seed=3))
    _, through_nominal = reachable(know(much), poses)
    targets, through_itself = reachable(know(much, controller=much.geometry), poses)
    assert len(through_nominal) < len(through_itself)
    np.testing.assert_allclose(through_itself.positions, targets.poses.positions, atol=1e-8)


@pytest.mark.parametrize(
    "change", [{"tilt": 0.1}, {"joint_min": -480.0}, {"joint_max": 480.0}, {"singularity_margin": 0.12}]
)
def test_every_limit_reduces_the_candidates(know, much, limits, found, change):
    tighter = know(much, limits=replace(limits, **change))
    fewer, _ = reachable(tighter, PoseBatch.at([0.0, 0.0, 550.0], orientations(256, TILT, seed=3)))
    assert 0 < len(fewer) < len(found[0])


def test_tilts_are_those_of_the_commands_in_whatever_frames_these_are(limits, hexaglide, paper):
    """A platform frame that is turned by 8 degrees about x: the limit moves with it."""
    turned = Rotation.from_rotvec(np.radians([-8.0, 0.0, 0.0])).as_matrix()
    frames = FrameTransform(np.eye(3), np.zeros(3), turned)
    here = replace(limits, tilt=float(np.radians(20.0)), frames=frames)
    commands = PoseBatch.of([Pose(0, 0, 550, 19), Pose(0, 0, 550, 21), Pose(0, 0, 550, -21)])
    poses = frames.poses(commands)
    np.testing.assert_allclose(np.degrees(poses.tilts()), [27.0, 29.0, 13.0])
    joints = hexaglide.inverse(paper.nominal, paper.branch, poses)
    np.testing.assert_array_equal(here.allow_poses(poses, joints), [True, False, False])
    level = PoseBatch.at([0.0, 0.0, 550.0], here.orientations(np.eye(3)[None]))
    np.testing.assert_allclose(frames.inverse().poses(level).tilts(), 0.0, atol=1e-7)


@pytest.fixture
def vague(know, paper):
    return know(paper.nominal, sigma_mm=1.0)


def test_poses_across_the_workspace_are_level_and_tilted_at_every_point(vague, paper):
    poses = workspace_poses(vague, paper.points[:1])
    assert len(poses) == 7
    assert np.unique(np.round(np.degrees(poses.tilts()), 6)).tolist() == [0.0, 15.0]
    assert np.allclose(poses.positions, paper.points[0])


def test_their_tilts_keep_a_smaller_limit(vague, paper):
    narrow = replace(vague, limits=replace(vague.limits, tilt=np.radians(8.0)))
    assert np.degrees(workspace_poses(narrow, paper.points[:2]).tilts()).max() == pytest.approx(8.0)


def test_those_out_of_reach_are_left_out(vague):
    assert len(workspace_poses(vague, np.array([[0.0, 2000.0, 500.0]]))) == 0


def records(seed: int, count: int = 5, parameters: int = 7):
    """A covariance, a weight, and Jacobians and covariances of some records."""
    random = np.random.default_rng(seed)
    roots = random.normal(size=(2, parameters, parameters))
    noise_roots = random.normal(size=(count, 3, 3))
    noise = noise_roots @ np.swapaxes(noise_roots, -1, -2) + 0.1 * np.eye(3)
    return *(root @ root.T for root in roots), random.normal(size=(count, 3, parameters)), noise


@pytest.mark.parametrize("seed", range(3))
def test_a_gain_is_what_the_record_takes_off_the_weighted_variance_or_the_volume(seed):
    covariance, weight, jacobian, noise = records(seed)
    weighted = Criterion(weight).gain(covariance, jacobian, noise)
    of_volume = D_OPTIMAL.gain(covariance, jacobian, noise)
    for gain, volume, one, own in zip(weighted, of_volume, jacobian, noise, strict=True):
        after = covariance_update(covariance, one, own)
        assert gain == pytest.approx(np.trace(weight @ covariance) - np.trace(weight @ after), rel=1e-9)
        ratio = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(after)[1]
        assert volume == pytest.approx(0.5 * ratio, rel=1e-9)


FEW, MANY = 512, 16384
SEEDS = range(3, 6)


@pytest.fixture(scope="module", params=["little", "much"])
def space(request, know) -> CandidateSpace:
    """Of the first point, when little is known of the robot, and when much is."""
    found = request.getfixturevalue(request.param)
    belief = know(found)
    return CandidateSpace(
        belief,
        gauge_zero_at(belief, found, 1),
        lambda some: D_OPTIMAL.gain(belief.covariance, some.jacobian, some.covariance),
    )


def rated(space: CandidateSpace, count: int, seed: int = SEEDS[0]) -> RatedRecords:
    turns = orientations(count, TILT, seed, Amplitudes.MOSTLY_LARGE)
    found = space.rated(turns @ space.zero.orientation)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def candidates(space) -> RatedRecords:
    return rated(space, FEW)


@pytest.fixture(scope="module", params=[QUICK, THOROUGH], ids=["quick", "thorough"])
def rounds(request) -> Rounds:
    found: Rounds = request.param
    return found


@pytest.fixture(scope="module")
def refined(space, candidates, rounds) -> RatedRecords:
    found: RatedRecords = space.refined(candidates, rounds)
    return found


def test_few_refined_ones_gain_more_than_the_best_of_thirty_times_as_many(space) -> None:
    many, quick, thorough = (
        np.mean([found.gains.max() for found in each])
        for each in (
            [rated(space, MANY, seed) for seed in SEEDS],
            [space.refined(rated(space, FEW, seed), QUICK) for seed in SEEDS],
            [space.refined(rated(space, FEW, seed), THOROUGH) for seed in SEEDS],
        )
    )
    assert many < quick < thorough


def test_all_candidates_stay_and_all_are_possible(space, candidates, refined) -> None:
    assert set(candidates.gains.tolist()) <= set(refined.gains.tolist())
    again = space.rated(refined.records.targets.poses.rotations)
    assert again is not None
    np.testing.assert_allclose(again.gains, refined.gains, rtol=1e-9)
    used = np.abs(refined.records.deviation) + SAFETY_SIGMAS * refined.records.sigma
    assert used.max() <= TRAVEL_SHARE * space.belief.limits.gauge_travel_mm


@given(
    angles=st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=30),
    most=st.integers(1, 12),
    apart=st.floats(0.01, 1.0),
)
def test_orientations_apart(angles: list[float], most: int, apart: float) -> None:
    """About one axis, where the angle between two is plain."""
    turned = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()
    rows = rows_apart(turned, np.arange(len(angles)), most, apart).tolist()
    between = np.abs(np.subtract.outer(angles, angles))
    between = np.minimum(between, 2.0 * np.pi - between)
    assert rows[0] == 0
    assert rows == sorted(set(rows))
    assert len(rows) <= most
    assert all(between[a, b] > apart - 1e-6 for a in rows for b in rows if a != b)
    left_out = set(range(len(angles))) - set(rows)
    if len(rows) < most:
        assert all(min(between[row, kept] for kept in rows) <= apart + 1e-6 for row in left_out)


@pytest.fixture(params=[2.0, 8.0])
def asked(know, little, limits, request):
    """The constraint after a few records, and candidates of which some keep it."""
    belief = know(little, limits=replace(limits, gauge_travel_mm=request.param))
    zero = gauge_zero_at(belief, little, 1)
    turned = orientations(64, float(np.radians(30.0)), seed=4) @ zero.orientation
    targets = reachable_targets(belief, PoseBatch.at(zero.reference, turned))
    return TravelConstraint(belief, zero), predict_records(belief, zero, targets)


def test_stages_exclude_what_all_samples_at_once_exclude(asked, monkeypatch):
    constraint, records = asked
    assert constraint.is_uncertain
    in_stages = constraint.holds(records)
    monkeypatch.setattr(travel_monte_carlo, "STAGES_UNCERTAIN", ())
    np.testing.assert_array_equal(in_stages, constraint.holds(records))
    assert in_stages.any()
    assert not in_stages.all()


def test_a_target_is_judged_alike_alone_and_among_others(asked):
    constraint, records = asked
    together = constraint.holds(records)
    rows = np.append(np.flatnonzero(together)[:3], np.flatnonzero(~together)[:3])
    for row in rows:
        assert constraint.holds(records[np.array([row])])[0] == together[row]
