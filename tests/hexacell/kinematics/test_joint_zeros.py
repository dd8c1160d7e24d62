"""Joint variables and the encoders' zeros together, against geometries whose zeros were moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import inverse_kinematics, joint_zeros
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot.model import robot_of

CONFIGS = Path(__file__).parents[3] / "configs"


@pytest.mark.parametrize("name", ["simulated-hexaglide", "gough-stewart", "linapod", "rotary-cranks"])
def test_moved_zeros_change_joint_variables_and_not_what_includes_them(name: str) -> None:
    cell = load_cell(CONFIGS / f"{name}.toml")
    robot = robot_of(cell)
    mechanism, geometry = robot.mechanism, robot.controller
    poses = PoseBatch.of([Pose(*pose) for pose in cell.settings.task.poses])
    moved = np.array([1.0, -2.0, 0.5, 3.0, -0.1, 0.0])
    other = Geometry(geometry.parameters, geometry.vector + mechanism.encoder_zeros(geometry) @ moved)
    joints, of_other = (
        inverse_kinematics(mechanism, one, robot.branch, poses) for one in (geometry, other)
    )
    np.testing.assert_allclose(joints - of_other, np.broadcast_to(moved, joints.shape), atol=1e-9)
    np.testing.assert_allclose(
        joints + joint_zeros(mechanism, geometry), of_other + joint_zeros(mechanism, other), atol=1e-9
    )


def test_a_gough_stewart_joint_with_its_zero_is_the_length_of_the_leg() -> None:
    robot = robot_of(load_cell(CONFIGS / "gough-stewart.toml"))
    pose = Pose(20.0, -30.0, 790.0, 5.0, -4.0, 10.0)
    joints = inverse_kinematics(robot.mechanism, robot.controller, robot.branch, PoseBatch.of([pose]))
    ends = pose.position + robot.controller["platform"] @ pose.rotation.T
    lengths = np.linalg.norm(ends - robot.controller["base"], axis=1)
    told = joints[0] + joint_zeros(robot.mechanism, robot.controller)
    np.testing.assert_allclose(told, lengths, atol=1e-9)
