"""Poses at the edges, and as arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.kinematics.pose import Pose, PoseBatch

length = st.floats(-1e3, 1e3)
angle = st.floats(-89.0, 89.0)
poses = st.builds(Pose, length, length, length, angle, angle, angle)


@given(poses)
def test_a_pose_converted_to_a_matrix_and_back_is_unchanged(pose):
    back = Pose.of(pose.position, pose.rotation)
    np.testing.assert_allclose(back.as_tuple(), pose.as_tuple(), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (slice(1, None), [1, 2]),
        ([2, 0], [2, 0]),
        (np.array([True, False, True]), [0, 2]),
        (np.array([1]), [1]),
    ],
)
def test_rows_are_taken_from_positions_and_rotations_alike(rows, expected):
    all_of_them = [Pose(0, 0, 1, 10), Pose(0, 0, 2, 20), Pose(0, 0, 3, 30)]
    taken = PoseBatch.of(all_of_them)[rows]
    assert [taken.pose(row).z for row in range(len(taken))] == [all_of_them[n].z for n in expected]
    assert [round(taken.pose(row).a) for row in range(len(taken))] == [all_of_them[n].a for n in expected]


def test_tilt_is_the_angle_between_the_z_axes_whatever_the_turn_about_them():
    tilts = PoseBatch.of(
        [Pose(0, 0, 0), Pose(0, 0, 0, 30, 0, 70), Pose(0, 0, 0, 0, -40), Pose(0, 0, 0, 60, 60)]
    )
    np.testing.assert_allclose(
        np.degrees(tilts.tilts()), [0.0, 30.0, 40.0, np.degrees(np.arccos(0.25))], atol=1e-6
    )


def test_poses_that_differ_by_rounding_alone_are_the_same():
    poses = PoseBatch.of(
        [Pose(1, 2, 3, 4, 5, 180), Pose(1, 2, 3 + 1e-9, 4, 5, -180), Pose(1, 2, 3, 4, 5, 179.99)]
    )
    assert poses.is_same(poses[:1]).tolist() == [True, True, False]
