"""The mechanisms that come with the package pass what every other one must."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from hexacell.cell.loader import load_cell
from hexacell.conformance import MechanismConformance, MechanismExample
from hexacell.kinematics.mechanisms.six_rails import SixRails
from hexacell.kinematics.rotations import turns_of
from hexacell.robot.model import robot_of
from tests.geometries import six_rails_geometry

CONFIGS = Path(__file__).parents[4] / "configs"


def example_of(name: str) -> MechanismExample:
    """The drawing of a bundled cell, and its points."""
    cell = load_cell(CONFIGS / f"{name}.toml")
    robot, settings = robot_of(cell), cell.settings
    points = np.array(settings.identification.points)
    return MechanismExample(robot.mechanism, robot.drawing, robot.branch, points, robot.tolerances.by_kind)


class TestHexaglide(MechanismConformance):
    example = example_of("simulated-hexaglide")


class TestGoughStewart(MechanismConformance):
    example = example_of("gough-stewart")


class TestVerticalRails(MechanismConformance):
    example = example_of("linapod")


class TestRotaryCranks(MechanismConformance):
    example = example_of("rotary-cranks")


class TestFiveLegs(MechanismConformance):
    example = example_of("five-legs")


class TestFourArms(MechanismConformance):
    example = replace(example_of("four-arms"), tilt_deg=50.0)


def with_rails(directions: np.ndarray) -> MechanismExample:
    """The Linapod with rails along other vectors (6, 3)."""
    vertical = example_of("linapod")
    turns = turns_of(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    drawn = vertical.drawing
    drawing = six_rails_geometry(drawn["S"], turns, drawn["B"], drawn["l"])
    return replace(vertical, drawing=drawing, points=vertical.points * (1.0, 1.0, 0.3) + (0.0, 0.0, 150.0))


class TestCrossedRails(MechanismConformance):
    """The two rails of a column lean against each other."""

    example = with_rails(np.array([(0.1 * (-1) ** leg, 0.05 * (leg % 3 - 1), 1.0) for leg in range(6)]))


def parallel_rails() -> MechanismExample:
    """The Hexaglide's, whose directions are not taken for granted."""
    paper = example_of("simulated-hexaglide")
    S, B, l = (paper.drawing[symbol] for symbol in ("S", "B", "l"))  # noqa: E741 - the paper's symbol
    drawing = six_rails_geometry(S, np.tile([0.0, np.pi / 2], (6, 1)), B, l)
    tolerances = {"S": 2.0, "rail": 0.002, "B": 2.0, "l": 2.0}
    return replace(paper, mechanism=SixRails(), drawing=drawing, tolerances=tolerances)


class TestParallelRails(MechanismConformance):
    example = parallel_rails()
