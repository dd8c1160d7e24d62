"""Micrometres are shown in um; parameters that are angles count in mrad where others do in mm."""

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
from hexacell.lengths import MM, UM, from_to, shown, unit_of
from hexacell.results.run_comparison import ParameterDifference
from hexacell.robot.model import Robot, robot_of
from hexacell.robot.virtual_robot import random_robot
from hexacell.text.identification import drawing_table
from hexacell.text.layout import figure_with_u
from hexacell.text.parameters import rows_of_changes
from hexacell.uncertainty.statement import LargestError
from hexacell.verdict.decision import JudgedError
from tests.records_within_travel import within_travel


@pytest.mark.parametrize(
    ("sizes", "unit"),
    [
        ((0.012, 0.08), MM),
        ((0.0004, 0.05), MM),
        ((0.0004, 0.003), UM),
        ((0.0, 0.0), MM),
        ((None, 2e-5), UM),
    ],
)
def test_sizes_that_belong_together_have_one_unit(sizes, unit) -> None:
    assert unit_of(*sizes) is unit
    assert unit_of(*sizes, unit="mrad").name == "mrad"


def test_angles_that_would_be_nought_are_in_thousandths() -> None:
    assert unit_of(0.0, 0.004, unit="deg").length(0.004) == "0.004 deg"
    assert unit_of(0.0001, 0.0004, unit="deg").length(0.0004) == "0.40 mdeg"


@pytest.mark.parametrize(
    ("mm", "text"), [(0.15, "0.150 mm"), (0.00042, "0.42 um"), (0.0098, "9.80 um"), (0.0, "0.000 mm")]
)
def test_no_length_but_nought_is_shown_as_nought(mm, text) -> None:
    assert shown(mm) == text


def test_lengths_are_told_with_the_digits_that_count() -> None:
    assert from_to(3.7412, 0.1503, 2) == "3.74 -> 0.150 mm"
    assert from_to(0.0213, 0.00041) == "0.021 mm -> 0.41 um"
    error = JudgedError.of(LargestError(0.0004, 0.003), 0.02, 1.5)
    assert error.sentence("mm") == "0.40 +- 3.00 um (limit 20)"
    coarse = JudgedError.of(LargestError(0.0004, 0.05), 0.3, 1.0)
    assert coarse.sentence("mm") == "0.000 +- 0.050 mm (limit 0.3)"
    assert figure_with_u(0.0004, 0.003) == "0.40 +- 3.00 um"
    (row,) = rows_of_changes([ParameterDifference("l1", "mm", 580.0, 580.00031, 0.0002)])
    assert [row.figure(one) for one in (row.new, row.change, row.sigma)] == [
        "580.00031",
        "0.00031",
        "0.00020",
    ]


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
