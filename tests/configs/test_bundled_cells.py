"""The bundled cells load, fit together, and agree with the paper's tables."""

import re
from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.fields import GeometrySettings
from hexacell.cell.loader import Cell, describe, dump, load_cell
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.robot.model import Robot, robot_of
from tests.hexacell.conftest import ACTUAL, CALIBRATED, NOMINAL, POINTS

CONFIGS = Path(__file__).parents[2] / "configs"


def same(settings: GeometrySettings, table: Geometry) -> None:
    stated = Geometry.of(HEXAGLIDE_PARAMETERS, settings.model_dump())
    np.testing.assert_array_equal(stated.vector, table.vector)


def test_simulated_hexaglide_is_table_1():
    settings = load_cell(CONFIGS / "simulated-hexaglide.toml").settings
    assert settings.simulation is not None
    same(settings.robot.nominal, NOMINAL)
    same(settings.simulation.geometry, ACTUAL)
    np.testing.assert_array_equal(settings.identification.points, POINTS[:5])
    assert settings.identification.orientations == 17
    assert settings.verification.points == (tuple(POINTS[5]), (0, -100, 600), (100, 100, 550))
    assert settings.limits.gauge_travel_mm == 5
    assert settings.tolerances.model_dump() == {"S_mm": 7, "B_mm": 7, "l_mm": 7, "ball_mm": 0}
    assert {settings.noise.encoder, settings.noise.gauge_mm} == {0.01}
    assert [gauge.protocol for gauge in settings.gauges] == ["sylvac", "mux10", "cdi"]
    assert settings.stations.placement == "fixed"
    assert settings.acceptance.approval == "automatic"


def test_paper_experiment_is_tables_3_and_4():
    settings = load_cell(CONFIGS / "paper-experiment.toml").settings
    assert settings.simulation is not None
    same(settings.robot.nominal, NOMINAL)
    same(settings.simulation.geometry, CALIBRATED)
    np.testing.assert_array_equal(settings.identification.points, POINTS[:3])
    np.testing.assert_array_equal(settings.verification.points, POINTS[3:])
    assert (settings.identification.orientations, settings.verification.orientations) == (20, 20)
    assert settings.tolerances.model_dump()["ball_mm"] == 40


PUBLISHED = ["camera-hexapod", "wpi-hexapod"]
FEWER_JOINTS = ["five-legs", "four-arms"]
OTHERS = ["gough-stewart", "linapod", "rotary-cranks", "linuxcnc-hexapod/cell", *PUBLISHED, *FEWER_JOINTS]
NAMES = [*OTHERS, "simulated-hexaglide", "worn-hexaglide", "paper-experiment"]
NOT_THEIRS = re.compile(r"\b(slider|rail|hexaglide)", re.IGNORECASE)


@pytest.fixture(params=NAMES)
def cell(request: pytest.FixtureRequest) -> Cell:
    return load_cell(CONFIGS / f"{request.param}.toml")


@pytest.fixture
def robot(cell: Cell) -> Robot:
    return robot_of(cell)


@pytest.fixture
def truth(cell: Cell, robot: Robot) -> Geometry:
    assert cell.settings.simulation is not None
    values = cell.settings.simulation.geometry.model_dump()
    return Geometry.of(robot.mechanism.parameters, values)


def test_the_controller_starts_from_the_drawing(robot: Robot) -> None:
    assert robot.controller.largest_difference(robot.drawing) == 0.0


def test_the_machine_is_within_the_tolerances_and_uses_most_of_them(robot: Robot, truth: Geometry) -> None:
    ball = robot.tolerances.ball_mm * robot.mechanism.parameters.ball_offset.sum(axis=0)
    widths = robot.tolerances.widths(robot.mechanism.parameters) + ball
    shares = np.abs(truth.vector - robot.drawing.vector) / widths
    assert shares.max() <= 1.0
    assert shares.mean() > 0.3 or robot.tolerances.ball_mm > 0.0


def test_points_and_task_poses_can_be_reached(cell: Cell, robot: Robot, truth: Geometry) -> None:
    """Untilted at every point, and at the task's poses, by the drawing and by the built machine."""
    settings = cell.settings
    points = (*settings.identification.points, *settings.verification.points)
    poses = PoseBatch.of(
        [*(Pose(*point) for point in points), *(Pose(*pose) for pose in settings.task.poses)]
    )
    for geometry in (robot.drawing, truth):
        joints = inverse_kinematics(robot.mechanism, geometry, robot.branch, poses)
        assert robot.limits.allow_joints(joints).all()
        margins = singularity_margin(robot.mechanism, geometry, poses, joints)
        assert margins.min() > settings.limits.singularity_margin


def test_cells_written_and_read_again_are_unchanged(cell: Cell, tmp_path: Path) -> None:
    for text in (dump(cell.settings), describe(cell)):
        (tmp_path / "cell.toml").write_text(text)
        assert load_cell(tmp_path / "cell.toml").settings == cell.settings


def test_nothing_in_a_cell_file_is_in_words_of_another_mechanism(cell: Cell) -> None:
    if cell.settings.mechanism.words.guide is not None:
        pytest.skip("its joints are sliders on rails")
    for text in (describe(cell), cell.path.read_text(), cell.config_path.read_text()):
        assert not NOT_THEIRS.findall(text)


def test_effects_of_rails_are_those_of_machines_with_rails(robot: Robot) -> None:
    names = [effect.name for effect in robot.effects]
    assert f"repeatability of a {robot.mechanism.words.joint}" in names
    if robot.mechanism.words.guide is None:
        assert not [name for name in names if NOT_THEIRS.search(name)]
