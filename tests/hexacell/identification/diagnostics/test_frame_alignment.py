"""Pose errors after frame alignment."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hexacell.identification.diagnostics.frame_alignment import FrameFit, pose_errors
from hexacell.kinematics.mechanism import FrameTransform
from hexacell.kinematics.pose import PoseBatch

LENGTH = 180.0


@pytest.fixture
def poses():
    random = np.random.default_rng(4)
    turns = Rotation.from_rotvec(random.uniform(-0.5, 0.5, (12, 3))).as_matrix()
    return PoseBatch(random.uniform([-200.0, -200.0, 350.0], [200.0, 200.0, 750.0], (12, 3)), turns)


def change(size):
    base, platform = (
        Rotation.from_rotvec(size * np.array(v)).as_matrix() for v in ([1, -2, 3], [2, 1, -1])
    )
    return FrameTransform(base, 100.0 * size * np.array([3.0, -2.0, 1.0]), platform)


@pytest.mark.parametrize("size", [1e-3, 0.05])
def test_other_frames_are_no_error(poses, size):
    seen = change(size).poses(poses)
    assert np.abs(pose_errors(seen, poses)).max() > size
    left = pose_errors(FrameFit(poses, LENGTH).aligned(seen, seen), poses)
    assert np.abs(left).max() < 1e-8


def test_the_frames_found_on_some_poses_hold_for_others(poses):
    seen = change(0.05).poses(poses)
    left = FrameFit(poses[:8], LENGTH).aligned(seen[:8], seen[8:])
    assert np.abs(pose_errors(left, poses[8:])).max() < 1e-8


def test_aligned_errors_are_minimal(poses):
    random = np.random.default_rng(5)
    jitter = Rotation.from_rotvec(0.01 * random.standard_normal((12, 3))).as_matrix()
    wrong = PoseBatch(poses.positions + random.standard_normal((12, 3)), jitter @ poses.rotations)
    weights = np.repeat([1.0, LENGTH], 3)

    def cost(seen):
        return np.sum((pose_errors(seen, poses) * weights) ** 2)

    best = FrameFit(poses, LENGTH).aligned(wrong, wrong)
    for step in 1e-3 * np.vstack([np.eye(9), -np.eye(9)]):
        turns = Rotation.from_rotvec(step[3:].reshape(2, 3)).as_matrix()
        moved = FrameTransform(turns[0], 100.0 * step[:3], turns[1]).poses(best)
        assert cost(best) < cost(moved) < cost(wrong)


def test_linear_frame_removal_agrees_with_alignment_to_first_order(poses):
    errors = pose_errors(change(1e-6).poses(poses), poses)
    left = FrameFit(poses, LENGTH).remove_frame_motion(poses, errors[..., None], errors[..., None])
    assert left.shape == (12, 6, 1)
    assert np.abs(left).max() < 1e-8


def test_one_pose_alone_has_no_error(poses):
    one = poses[:1]
    seen = change(0.02).poses(one)
    left = FrameFit(one, LENGTH).aligned(seen, seen)
    assert np.abs(pose_errors(left, one)).max() < 1e-8


@pytest.mark.parametrize("axes", ["", "z", "xz"])
def test_a_base_frame_is_turned_about_the_axes_that_can_be_taught_alone(poses, axes):
    """Against scipy's general minimizer over as many numbers."""
    random = np.random.default_rng(6)
    jitter = Rotation.from_rotvec(1e-4 * random.standard_normal((12, 3))).as_matrix()
    seen = change(1e-3).poses(
        PoseBatch(poses.positions + 0.05 * random.standard_normal((12, 3)), jitter @ poses.rotations)
    )
    turns = np.eye(3)[["xyz".index(axis) for axis in axes]]
    weights = np.repeat([1.0, LENGTH], 3)

    def left(numbers):
        turn = turns.T @ numbers[3:-3] / LENGTH
        base, platform = Rotation.from_rotvec(turn), Rotation.from_rotvec(numbers[-3:] / LENGTH)
        there = FrameTransform(base.as_matrix(), numbers[:3], platform.as_matrix()).poses(seen)
        return (pose_errors(there, poses) * weights).ravel()

    best = least_squares(left, np.zeros(6 + len(axes)), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    aligned = FrameFit(poses, LENGTH, turns).aligned(seen, seen)
    cost = np.sum((pose_errors(aligned, poses) * weights) ** 2)
    assert cost == pytest.approx(np.sum(best.fun**2), rel=1e-6)
    free = np.sum((pose_errors(FrameFit(poses, LENGTH).aligned(seen, seen), poses) * weights) ** 2)
    assert cost > 1.5 * free
    linear = pose_errors(seen, poses)
    removed = FrameFit(poses, LENGTH, turns).remove_frame_motion(poses, linear, linear)
    np.testing.assert_allclose(removed[:, :3], pose_errors(aligned, poses)[:, :3], atol=2e-3)
