"""Frames are fitted before errors are compared, and chosen so that taught poses move least."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares, minimize
from scipy.spatial.transform import Rotation

from hexacell.identification.diagnostics.frame_alignment import (
    FrameFit,
    PoseErrors,
    choose_frames,
    closest_frames,
    pose_errors,
)
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import FrameFreedom
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import FrameTransform, Pose, PoseBatch
from tests.hexacell.conftest import reached, vector

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
def test_other_frames_are_no_error_of_poses_that_they_were_not_found_on_either(poses, size):
    seen = change(size).poses(poses)
    assert np.abs(pose_errors(seen, poses)).max() > size
    left = pose_errors(FrameFit(poses[:8], LENGTH).aligned(seen[:8], seen), poses)
    assert np.abs(left).max() < 1e-8


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


TASK = [
    Pose(0.0, 0.0, 550.0),
    Pose(0.0, -150.0, 550.0, 15.0),
    Pose(80.0, -80.0, 500.0, 0.0, 15.0, 10.0),
    Pose(-100.0, 100.0, 500.0, -10.0, 10.0, -20.0),
]
WORKSHOP = FrameTransform(
    base=Rotation.from_rotvec([-0.7, 0.0, 0.0]).as_matrix(),
    origin=np.array([50.0, 200.0, -900.0]),
    platform=Rotation.from_rotvec([0.3, 0.1, -0.5]).as_matrix(),
)
"""From the paper's frames to those in which the robot was taught."""

place = st.floats(-500.0, 500.0)
turn = st.floats(-1.5, 1.5)


class Chosen(NamedTuple):
    """The new geometry in the chosen frames, and how far the taught poses move nevertheless."""

    geometry: Geometry
    displacement: PoseErrors


@pytest.fixture(scope="module")
def calibrated(paper) -> Chosen:
    """The paper's simulated robot, taught by its drawing."""
    return choose(paper, TASK)


def choose(paper: Any, poses: list[Pose]) -> Chosen:
    """The frames after the calibration of a robot that was taught with its drawing."""
    return chosen_for(paper, paper.nominal, PoseBatch.of(poses))


def chosen_for(paper: Any, taught: Geometry, poses: PoseBatch) -> Chosen:
    return Chosen(*choose_frames(Hexaglide(), paper.branch, taught=taught, new=paper.actual, poses=poses))


@given(st.tuples(place, place, place), turn, st.tuples(turn, turn, turn))
def test_the_same_machine_returns_to_the_frames_it_was_taught_in(paper, origin, roll, platform):
    change = FrameTransform(
        Rotation.from_rotvec([roll, 0.0, 0.0]).as_matrix(),
        np.array(origin),
        Rotation.from_rotvec(platform).as_matrix(),
    )
    taught = Hexaglide().change_frames(paper.actual, change)
    poses = change.poses(PoseBatch.of(TASK))
    chosen = chosen_for(paper, taught, poses)
    assert len(chosen.displacement.distances_mm) == len(TASK)
    np.testing.assert_allclose(chosen.geometry.vector, taught.vector, atol=1e-8)
    assert chosen.displacement.position_largest_mm < 1e-8
    assert chosen.displacement.orientation_largest_deg < 1e-8


def test_no_other_frames_move_the_task_poses_less(paper, calibrated):
    """A general minimizer over six numbers, on poses that scipy found, gets as far and no farther."""
    seen = [reached(paper.actual, paper.nominal, pose)[1] for pose in TASK]
    wanted = np.array([vector(pose) for pose in TASK])
    length = np.linalg.norm(paper.actual["B"], axis=1).mean()

    def left(frames):
        moved = np.array(seen)[:, :3] + frames[:3]
        turned = Rotation.from_rotvec(np.array(seen)[:, 3:]) * Rotation.from_rotvec(frames[3:])
        return moved - wanted[:, :3], (turned * Rotation.from_rotvec(wanted[:, 3:]).inv()).as_rotvec()

    def cost(frames):
        distance, angle = left(frames)
        return float(np.sum(distance**2) + length**2 * np.sum(angle**2))

    best = minimize(cost, np.zeros(6), method="BFGS", options={"gtol": 1e-7}).x
    distance, angle = left(best)
    found = calibrated.displacement
    np.testing.assert_allclose(found.distances_mm, np.linalg.norm(distance, axis=1), rtol=1e-4)
    np.testing.assert_allclose(found.angles, np.linalg.norm(angle, axis=1), rtol=1e-4)
    assert cost(np.zeros(6)) > 1.5 * cost(best)  # the convention's frames move them farther


def test_the_chosen_geometry_has_the_displaced_poses_at_the_joints_of_the_taught_ones(
    paper, legs, calibrated
):
    for row, pose in enumerate(TASK):
        joints = legs(paper.nominal).joints(vector(pose))
        there = legs(calibrated.geometry).closed(joints, vector(pose))
        angle = Rotation.from_rotvec(there[3:]) * Rotation.from_rotvec(vector(pose)[3:]).inv()
        distance = np.linalg.norm(there[:3] - vector(pose)[:3])
        assert distance == pytest.approx(calibrated.displacement.distances_mm[row], abs=1e-7)
        assert angle.magnitude() == pytest.approx(calibrated.displacement.angles[row], abs=1e-9)


def test_the_chosen_geometry_is_the_new_one_in_other_frames(paper, calibrated):
    back, _ = Hexaglide().normalize_frames(calibrated.geometry)
    np.testing.assert_allclose(back.vector, paper.actual.vector, atol=1e-9)


def test_the_displacement_does_not_depend_on_the_frames_of_teaching(paper, calibrated):
    taught = Hexaglide().change_frames(paper.nominal, WORKSHOP)
    poses = WORKSHOP.poses(PoseBatch.of(TASK))
    elsewhere = chosen_for(paper, taught, poses)
    np.testing.assert_allclose(
        elsewhere.displacement.distances_mm, calibrated.displacement.distances_mm, rtol=1e-9
    )
    expected = Hexaglide().change_frames(calibrated.geometry, WORKSHOP)
    np.testing.assert_allclose(elsewhere.geometry.vector, expected.vector, atol=1e-8)
    # The base is not turned: the gauges stay along its axes.
    for chosen, turned in ((calibrated, np.eye(3)), (elsewhere, WORKSHOP.base)):
        _, back = Hexaglide().normalize_frames(chosen.geometry)
        np.testing.assert_allclose(back.base, turned.T, atol=1e-12)


def test_poses_out_of_reach_do_not_count_and_without_any_the_frames_stay(paper, calibrated) -> None:
    far = Pose(0.0, 900.0, 550.0)
    some = choose(paper, [TASK[0], far, *TASK[1:]])
    np.testing.assert_allclose(some.geometry.vector, calibrated.geometry.vector, atol=1e-9)
    assert len(some.displacement.distances_mm) == 4
    for poses in ([], [Pose(0.0, 900.0, 550.0)]):
        nothing = choose(paper, poses)
        np.testing.assert_array_equal(nothing.geometry.vector, paper.actual.vector)
        assert len(nothing.displacement.distances_mm) == 0


def test_one_pose_alone_stays_and_its_surroundings_follow_it(paper):
    alone = choose(paper, TASK[:1])
    assert alone.displacement.position_largest_mm < 1e-8
    assert alone.displacement.orientation_largest_deg < 1e-8
    near = PoseBatch.of([Pose(20.0, -20.0, 560.0, 5.0)])
    joints = Hexaglide().inverse(paper.nominal, paper.branch, near)
    found = forward_kinematics(Hexaglide(), alone.geometry, joints, near)
    assert found.found.all()
    assert np.linalg.norm(pose_errors(found.poses, near)[:, :3]) < 5.0


def test_rails_keep_their_direction_whatever_the_poses_ask_for():
    random = np.random.default_rng(7)
    targets = PoseBatch.of(Pose(*random.uniform(-200.0, 200.0, 3).tolist()) for _ in range(8))
    pitch = FrameTransform(
        Rotation.from_rotvec([0.01, 0.02, 0.03]).as_matrix(), np.array([1.0, 2.0, 3.0]), np.eye(3)
    )
    rails = closest_frames(Hexaglide.frame_freedom, 100.0, pitch.poses(targets), targets)
    np.testing.assert_allclose(rails.base[0], [1.0, 0.0, 0.0], atol=1e-15)
    left = pose_errors(rails.poses(pitch.poses(targets)), targets)
    assert np.abs(left[:, :3]).max() > 1.0
    free = closest_frames(FrameFreedom(), 100.0, pitch.poses(targets), targets)
    np.testing.assert_allclose(free.base @ pitch.base, np.eye(3), atol=1e-9)
