"""Inverse kinematics against LinuxCNC, and poses out of reach."""

from __future__ import annotations

import numpy as np
import pytest

from hexacell.errors import ExitCode, ReachError
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.geometries import hexaglide_geometry


def test_inverse_agrees_with_linuxcnc(inverse, paper):
    """LinuxCNC 2.9 running a hexaglide kinematics module of its own, docs/linuxcnc.md."""
    joints = inverse(paper.nominal, PoseBatch.of([Pose(10, 20, 560, 5, -4, 3)]))
    expected = [-461.827519, -455.741652, -448.908104, 465.952312, 465.044723, 488.923462]
    np.testing.assert_allclose(joints, [expected], atol=6e-7)


def test_a_pose_out_of_reach_names_the_leg_and_the_pose(inverse, paper):
    lengths = paper.nominal["l"].copy()
    lengths[3] = 400.0
    short_leg_4 = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], lengths)
    poses = PoseBatch.of([Pose(0, 0, 500), Pose(0, 0, 550), Pose(0, 0, 560, 1)])
    with pytest.raises(
        ReachError, match=r"^leg 4 cannot reach the pose X0\.000 Y0\.000 Z550\.000 "
    ) as caught:
        inverse(short_leg_4, poses)
    assert caught.value.exit_code is ExitCode.USAGE
