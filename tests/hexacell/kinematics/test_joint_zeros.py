"""Joint variables and the encoders' zeros together, against geometries whose zeros were moved."""

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
