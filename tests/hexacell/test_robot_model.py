"""The robot of a cell: the drawing and the limits of its file, the geometry and frames of its config."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.cell.loader import load_cell
from hexacell.config.interface import ControllerGeometry
from hexacell.config.toml_format import native_layout
from hexacell.errors import FileError
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import FrameTransform, Pose, PoseBatch
from hexacell.robot.model import make_robot, robot_of

CELL = Path(__file__).parents[2] / "configs" / "simulated-hexaglide.toml"
TO_FLOOR = FrameTransform(
    base=Rotation.from_rotvec([-0.7, 0.0, 0.0]).as_matrix(),
    origin=np.array([50.0, 200.0, -900.0]),
    platform=Rotation.from_rotvec([0.3, 0.1, -0.5]).as_matrix(),
)
"""From the paper's frames to those of a config with its origin on the floor and its base rolled."""
angle = st.floats(-20.0, 20.0)
poses = st.builds(Pose, st.floats(-80, 80), st.floats(-80, 80), st.floats(500, 580), angle, angle, angle)


@pytest.fixture(scope="module")
def cell():
    return load_cell(CELL)


@pytest.fixture(scope="module")
def robot(cell):
    return robot_of(cell)


@pytest.fixture(scope="module")
def on_floor(cell, paper):
    """The same robot, its controller's config in other frames."""
    return make_robot(
        cell.settings, ControllerGeometry(Hexaglide().change_frames(paper.nominal, TO_FLOOR), paper.branch)
    )


@pytest.fixture
def copied(cell, tmp_path):
    """The bundled cell in a folder of its own, with a copy of its config from the time of teaching."""
    for name in (CELL.name, "simulated-hexaglide.controller.toml"):
        (tmp_path / name).write_bytes((CELL.parent / name).read_bytes())
    path = tmp_path / CELL.name
    path.write_text(path.read_text().replace('# taught = "robot-taught', 'taught = "robot-taught'))
    copied = load_cell(path)
    assert copied.taught_path == tmp_path / "robot-taught.toml"
    return copied


def test_the_taught_geometry_is_in_the_file_that_the_cell_names(copied, paper):
    text = copied.config_path.read_text()
    copied.taught_path.write_text(native_layout(HEXAGLIDE_PARAMETERS).rewrite([text], paper.actual)[0])
    robot = robot_of(copied)
    assert robot.taught is not None
    np.testing.assert_allclose(robot.taught.vector, paper.actual.vector)
    np.testing.assert_array_equal(robot.controller.vector, paper.nominal.vector)


def test_a_taught_config_must_exist_and_be_of_this_robot(copied):
    with pytest.raises(FileError, match="robot-taught"):
        robot_of(copied)
    text = copied.config_path.read_text()
    copied.taught_path.write_text(text.replace("branch = [-1,", "branch = [1,"))
    with pytest.raises(FileError, match=r"robot-taught.*branch is not that of the controller"):
        robot_of(copied)


def test_limits_are_in_millimetres_and_radians(robot):
    assert robot.limits.gauge_travel_mm == 5.0
    assert robot.limits.tilt == pytest.approx(np.pi / 4)
    assert robot.limits.turn == pytest.approx(np.pi / 3)
    assert robot.limits.joint_ranges == ((-800.0, 200.0),) * 3 + ((-200.0, 800.0),) * 3
    assert np.degrees(robot.limits.legs.platform_cones) == pytest.approx(np.full(6, 45.0))
    assert robot.limits.singularity_margin == 0.03


@pytest.fixture
def beside_linuxcnc(copied):
    """The same cell, whose [limits] name an INI file with other limits of axes and joints."""
    (copied.path.parent / "machine.ini").write_text(
        "\n".join(
            ["[AXIS_A]", "MIN_LIMIT = -45", "MAX_LIMIT = 40"]
            + [f"[JOINT_{n}]\nMIN_LIMIT = -900\nMAX_LIMIT = {100 + n}" for n in range(6)]
        )
    )
    (copied.path.parent / "robot-taught.toml").write_bytes(copied.config_path.read_bytes())
    limits = copied.settings.limits.model_copy(update={"ini": "machine.ini"})
    return replace(copied, settings=copied.settings.model_copy(update={"limits": limits}))


def test_limits_of_the_ini_file_hold_as_well(robot, beside_linuxcnc):
    found = robot_of(beside_linuxcnc).limits
    assert (found.axes.lowest[3], found.axes.highest[3]) == (-45.0, 40.0)
    expected = [(low, min(high, 100.0 + n)) for n, (low, high) in enumerate(robot.limits.joint_ranges)]
    assert found.joint_ranges == tuple(expected)


def test_ranges_of_joints_that_include_zeros_follow_the_zeros(beside_linuxcnc, paper):
    settings = beside_linuxcnc.settings
    controller = settings.controller.model_copy(update={"joints_include_zeros": True})
    cell = replace(beside_linuxcnc, settings=settings.model_copy(update={"controller": controller}))
    robot = robot_of(cell)
    shifted = robot.mechanism.change_frames(
        robot.controller, FrameTransform(np.eye(3), np.array([30.0, 0.0, 0.0]), np.eye(3))
    )
    assert robot.limits.joint_ranges[5][1] == pytest.approx(105.0 - robot.controller["S"][5, 0])
    assert robot.with_controller(shifted).limits.joint_ranges[5][1] == pytest.approx(135.0)
    lent = robot.with_provisional(robot.mechanism.normalize_frames(paper.actual)[0])
    written = robot.for_controller(lent.provisional[0])
    assert lent.limits.joint_ranges[5][1] == pytest.approx(105.0 - written["S"][5, 0])


@given(poses)
def test_a_command_brings_the_controllers_own_robot_to_the_pose(on_floor, hexaglide, paper, pose):
    command = PoseBatch.of([on_floor.to_command(pose)])
    np.testing.assert_allclose(
        inverse_kinematics(hexaglide, on_floor.controller, paper.branch, command),
        inverse_kinematics(hexaglide, paper.nominal, paper.branch, PoseBatch.of([pose])),
        atol=1e-9,
    )


def test_a_geometry_returns_to_the_configs_frames(on_floor, hexaglide, paper):
    written = on_floor.for_controller(paper.actual)
    np.testing.assert_allclose(
        written.vector, Hexaglide().change_frames(paper.actual, TO_FLOOR).vector, atol=1e-9
    )
    same = on_floor.for_controller(hexaglide.normalize_frames(on_floor.controller)[0])
    np.testing.assert_allclose(same.vector, on_floor.controller.vector, atol=1e-9)


def test_the_belief_before_measuring_is_the_drawing_with_its_tolerances(robot, on_floor, paper):
    for known in (robot.belief(), on_floor.belief()):
        np.testing.assert_allclose(known.estimate.vector, paper.nominal.vector, atol=1e-9)
        np.testing.assert_allclose(known.controller.vector, paper.nominal.vector, atol=1e-9)
        np.testing.assert_allclose(known.covariance, robot.prior.covariance, atol=1e-6)
