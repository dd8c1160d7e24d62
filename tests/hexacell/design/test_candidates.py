"""Candidate orientations, and the commands that bring the controller to the intended joint variables."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.design.candidates import orientations, reachable, workspace_poses
from hexacell.kinematics.mechanism import FrameTransform
from hexacell.kinematics.pose import Pose, PoseBatch

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


def test_inverse_kinematics_of_the_commands_gives_the_joints(found, paper, legs, vector_of):
    targets, commands = found
    controller = legs(paper.nominal)
    for row, joints in enumerate(targets.joints):
        command = vector_of(commands.pose(row))  # as it is sent: six numbers
        np.testing.assert_allclose(controller.joints(command), joints, atol=1e-6)


def test_candidates_keep_the_singularity_margin_of_both_geometries(found, much, paper, legs):
    targets, commands = found
    for poses, geometry in ((targets.poses, much.geometry), (commands, paper.nominal)):
        for vector, joints in zip(as_vectors(poses), targets.joints, strict=True):
            assert legs(geometry).margin(joints, vector) > 0.05 - 1e-4


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
    np.testing.assert_allclose(here.tilts(level), 0.0, atol=1e-7)


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
