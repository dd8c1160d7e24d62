"""Parameters that are angles: in tolerances, limits and text they count in mrad where others do in mm."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.errors import FileError
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import Robot, robot_of
from hexacell.robot.virtual_robot import random_robot
from hexacell.text.identification import drawing_table
from tests.records_within_travel import within_travel

CONFIG = Path(__file__).parents[2] / "configs" / "linapod.toml"
TURN = np.cos(np.radians(10.0))
"""The convention's x axis is 10 degrees from the drawing's, and with it the axes that rails lean about."""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return robot_of(load_cell(CONFIG))


def identified(robot: Robot, built: Geometry) -> Identification:
    """From records without noise of a robot in the drawing's frames, which may be any robot."""
    settings = load_cell(CONFIG).settings
    truth, _ = robot.mechanism.normalize_frames(built)
    points, random = np.array(settings.identification.points), np.random.default_rng(2)
    data = within_travel(robot, truth, points, 11, np.radians(25.0), random)
    exact = replace(robot, noise=Noise(1e-4, 1e-4))
    return identify(exact.problem(data.measured(0.0, random)))


def changed(robot: Robot, name: str, change: float) -> Geometry:
    parameters = robot.mechanism.parameters
    step = change * (np.arange(len(parameters)) == parameters.names.index(name))
    return Geometry(parameters, robot.drawing.vector + step)


def test_a_difference_of_an_angle_counts_in_mrad(robot: Robot) -> None:
    assert changed(robot, "rail2a", 0.004).largest_difference(robot.drawing) == pytest.approx(4.0)
    assert changed(robot, "S2x", 0.004).largest_difference(robot.drawing) == pytest.approx(0.004)


def test_robots_within_their_tolerances_are_not_refused_and_a_rail_beyond_is_named(robot: Robot) -> None:
    random = np.random.default_rng(8)
    for _ in range(4):
        built = random_robot(robot.mechanism, robot.drawing, robot.tolerances, random)
        assert robot.tolerance_violations(identified(robot, built).estimate) == ()
    built = changed(robot, "rail5b", 0.006)
    (violation,) = robot.tolerance_violations(identified(robot, built).estimate)
    assert violation.name == "rail5b"
    assert violation.change == pytest.approx(6.0, abs=2.1)
    assert (violation.tolerance, violation.unit) == (2.0, "mrad")


def test_the_table_has_them_in_mrad(robot: Robot) -> None:
    found = identified(robot, changed(robot, "rail2a", 0.0015))
    lines = drawing_table(found, robot.mechanism.normalize_frames(robot.drawing)[0])
    assert len({line.index(".") for line in lines[1:]}) == 1
    (line,) = (line for line in lines if line.startswith("rail2a"))
    name, unit, *numbers = line.split()
    assert (name, unit) == ("rail2a,", "mrad")
    assert [float(number) for number in numbers[:3]] == pytest.approx(
        [0.0, 1.5 * TURN, 1.5 * TURN], abs=2e-3
    )


def test_a_drawing_of_other_rails_is_another_robots(tmp_path: Path) -> None:
    for path in CONFIG.parent.glob("linapod*.toml"):
        (tmp_path / path.name).write_text(path.read_text())
    config = tmp_path / "linapod.controller.toml"
    config.write_text(config.read_text().replace("  [0.0, 0.0],  # leg 4", "  [0.0, 0.7],  # leg 4"))
    with pytest.raises(FileError, match=rf"rail4 b differs by {700 * TURN:.1f} mrad once both"):
        robot_of(load_cell(tmp_path / "linapod.toml"))
