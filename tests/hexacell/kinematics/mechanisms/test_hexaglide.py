"""The Hexaglide's leg equation: what closes, how it changes, and its inverse on every branch."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.errors import ExitCode, ReachError
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.geometries import hexaglide_geometry
from tests.hexacell.kinematics.numeric import POSES

BRANCHES = list(product((-1, 1), repeat=6))


@given(POSES)
def test_inverse_is_the_closed_form(hexaglide, paper, legs, vector_of, pose):
    expected = legs(paper.actual).joints(vector_of(pose))
    found = hexaglide.inverse(paper.actual, paper.branch, PoseBatch.of([pose]))[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)  # NaN where NaN is expected


@given(POSES, st.sampled_from(BRANCHES))
def test_every_branch_closes_the_legs_and_is_recognised(hexaglide, paper, pose, branch):
    at = PoseBatch.of([pose])
    joints = hexaglide.inverse(paper.nominal, branch, at)
    if np.isnan(joints).any():
        return
    np.testing.assert_allclose(
        hexaglide.residual_and_jacobian(paper.nominal, at, joints)[0], 0.0, atol=1e-10
    )
    np.testing.assert_array_equal(hexaglide.branch(paper.nominal, at, joints), [branch])


def test_only_the_leg_that_cannot_reach_is_missing(hexaglide, paper):
    lengths = paper.nominal["l"].copy()
    lengths[3] = 300.0
    short = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], lengths)
    joints = hexaglide.inverse(short, paper.branch, PoseBatch.of([Pose(0, 0, 550), Pose(0, 0, 300)]))
    np.testing.assert_array_equal(np.isnan(joints), [[0, 0, 0, 1, 0, 0], [0] * 6])


def test_inverse_agrees_with_linuxcnc(hexaglide, paper):
    """LinuxCNC 2.9 running a hexaglide kinematics module of its own, docs/linuxcnc.md."""
    joints = inverse_kinematics(
        hexaglide, paper.nominal, paper.branch, PoseBatch.of([Pose(10, 20, 560, 5, -4, 3)])
    )
    expected = [-461.827519, -455.741652, -448.908104, 465.952312, 465.044723, 488.923462]
    np.testing.assert_allclose(joints, [expected], atol=6e-7)


def test_a_pose_out_of_reach_names_the_leg_and_the_pose(hexaglide, paper):
    lengths = paper.nominal["l"].copy()
    lengths[3] = 400.0
    short_leg_4 = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], lengths)
    poses = PoseBatch.of([Pose(0, 0, 500), Pose(0, 0, 550), Pose(0, 0, 560, 1)])
    with pytest.raises(
        ReachError, match=r"^leg 4 cannot reach the pose X0\.000 Y0\.000 Z550\.000 "
    ) as caught:
        inverse_kinematics(hexaglide, short_leg_4, paper.branch, poses)
    assert caught.value.exit_code is ExitCode.USAGE
