"""A pose beyond a limit is refused, in words with the value; one within is not."""

from pathlib import Path

import numpy as np
import pytest

from hexacell.campaign.feasibility import broken_limits
from hexacell.cell.loader import load_cell
from hexacell.config.interface import ControllerGeometry
from hexacell.kinematics.pose import Pose
from hexacell.robot.model import make_robot, robot_of
from tests.geometries import hexaglide_geometry

CELL = Path(__file__).parents[2] / "configs" / "simulated-hexaglide.toml"


@pytest.fixture(scope="module")
def cell():
    return load_cell(CELL)


def with_limits(cell, **limits):
    changed = type(cell.settings.limits).model_validate(cell.settings.limits.model_dump() | limits)
    return make_robot(
        cell.settings.model_copy(update={"limits": changed}),
        ControllerGeometry(robot_of(cell).controller, robot_of(cell).branch),
    )


def test_a_pose_within_the_limits_breaks_none(cell):
    assert [*broken_limits(robot_of(cell), Pose(0, 0, 550, 10, -10, 20))] == []


@pytest.mark.parametrize(
    ("pose", "problem"),
    [
        (Pose(0, 0, 899), "leg 1 cannot reach the pose X0.000 Y0.000 Z899.000"),
        (Pose(390, 0, 550), " mm, outside -200 to 800"),
        (Pose(0, 0, 550, 46.0), "the singularity margin is 0.00"),
        (Pose(0, 0, 550, 46.0), "is tilted by 46.0 deg, beyond tilt_deg = 45"),
        (Pose(0, 0, 550, 0, 0, 61.0), "is turned about its normal by 61.0 deg, beyond turn_deg = 60"),
        (Pose(0, 0, 550, 0, 44.0), " in its platform joint, beyond 45"),
    ],
)
def test_a_broken_limit_is_told_with_the_value(cell, pose, problem):
    assert any(problem in one for one in broken_limits(robot_of(cell), pose))


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ({"axes": {"z": (500.0, 540.0)}}, "axis z would be at 550.0, outside 500 to 540"),
        ({"axes": {"a": (-20.0, -5.0)}}, "axis a would be at 0.0, outside -20 to -5"),
        ({"joints_mm": [(-320.0, -310.0)] * 6}, "mm, outside -320 to -310"),
        ({"leg_distance_mm": 90.0}, "two legs come within 71.3 mm, leg_distance_mm is 90"),
        ({"passive_joints": {"base_cone_deg": 2.0}}, " in its base joint, beyond 2"),
    ],
)
def test_limits_of_the_cell_file_are_told(cell, limits, problem):
    found = [*broken_limits(with_limits(cell, **limits), Pose(0, 0, 550))]
    assert any(problem in one for one in found), found


def test_one_leg_with_a_smaller_cone_alone_refuses_a_pose(cell):
    cones = [45.0] * 6
    robot = with_limits(cell, passive_joints={"base_cone_deg": cones, "platform_cone_deg": 45.0})
    assert [*broken_limits(robot, Pose(0, 0, 550, 10, -10, 20))] == []
    cones[3] = 10.0
    robot = with_limits(cell, passive_joints={"base_cone_deg": 45.0, "platform_cone_deg": cones})
    [problem] = broken_limits(robot, Pose(0, 0, 550, 10, -10, 20))
    assert problem.startswith("leg 4 is turned by ")
    assert problem.endswith(" deg in its platform joint, beyond 10")


def test_reach_is_the_controllers_and_stated_axes_take_the_place_of_the_legs(cell) -> None:
    robot = robot_of(cell)
    short = hexaglide_geometry(robot.drawing["S"], robot.drawing["B"], np.full(6, 450.0))
    other = make_robot(cell.settings, ControllerGeometry(short, robot.branch))
    assert any("leg 1" in problem for problem in broken_limits(other, Pose(0, 0, 600)))
    # Straight down, as some machines have them: the inclined legs are far from that.
    down = [(0.0, 0.0, -2.0)] * 6
    robot = with_limits(cell, passive_joints={"base_cone_deg": 30.0, "base_axes": down})
    assert robot.limits.legs is not None
    np.testing.assert_allclose(robot.limits.legs.base_axes, np.tile([0.0, 0.0, -1.0], (6, 1)), atol=1e-12)
    assert any("in its base joint, beyond 30" in one for one in broken_limits(robot, Pose(0, 0, 550)))


def test_axes_are_the_legs_directions_in_the_middle_of_the_points_within_reach(cell):
    far = cell.settings.task.model_copy(update={"poses": ((0.0, 0.0, 5500.0, 0.0, 0.0, 0.0),)})
    settings = cell.settings.model_copy(update={"task": far})
    robot = robot_of(cell)
    told = make_robot(settings, ControllerGeometry(robot.controller, robot.branch))
    assert told.limits.legs is not None
    assert robot.limits.legs is not None
    np.testing.assert_allclose(told.limits.legs.base_axes, robot.limits.legs.base_axes, atol=0.2)
    assert np.isfinite(told.limits.legs.platform_axes).all()
