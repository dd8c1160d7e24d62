"""The mechanisms that come with the package pass what every other one must."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hexacell.cell.loader import load_cell
from hexacell.conformance import MechanismConformance, MechanismExample
from hexacell.robot_model import robot_of

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
