"""The robots of all cells that come with the package, as they are drawn at their first task pose."""

from dataclasses import dataclass

import pytest

from hexacell.cell.bundled import bundled_config, bundled_names
from hexacell.cell.loader import load_cell
from hexacell.drawing.robot_scene import DrawnRobot, robot_scene
from hexacell.drawing.shapes import Scene
from hexacell.kinematics.pose import Pose
from hexacell.services.robot_view import view_of_cell


@dataclass(frozen=True)
class Drawn:
    name: str
    robot: DrawnRobot
    pose: Pose

    @property
    def scene(self) -> Scene:
        return robot_scene(self.robot, self.pose)


def drawn(name: str) -> Drawn:
    path = bundled_config(name)
    view = view_of_cell(load_cell(path / "cell.toml" if path.is_dir() else path))
    return Drawn(name, view.robot, view.poses[-1])


@pytest.fixture(params=bundled_names())
def any_robot(request: pytest.FixtureRequest) -> Drawn:
    """Of each bundled cell."""
    return drawn(request.param)


@pytest.fixture
def hexaglide() -> Drawn:
    """Of the demo's cell."""
    return drawn("simulated-hexaglide")


@pytest.fixture
def cranks() -> Drawn:
    """Of the cell with cranks."""
    return drawn("rotary-cranks")
