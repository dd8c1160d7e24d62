"""The simulated Hexaglide on a clock that tests advance."""

import shutil
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.simulated.cell import SimulatedCell
from drivers.simulated.physics import RobotPhysics
from drivers.simulated.robot import SimulatedMachine
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.cell.model import CellSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock
from hexacell.config.toml_format import native_layout
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from tests.geometries import hexaglide_geometry
from tests.native_config import NATIVE

HOME = Pose(0.0, 0.0, 550.0)
STILL: dict[str, Any] = {
    "gauges.noise_mm": 0.0,
    "gauges.flicker_mm": 0.0,
    "encoders.noise_mm": 0.0,
    "encoders.flicker_mm": 0.0,
    "motion.ringing_mm": 0.0,
    "motion.repeatability_mm": 0.0,
    "station_reach_mm": 30.0,
}
"""A simulation without any scatter: readings are exact."""


class StillClock(CellClock):
    """Advances on request, and by the time of every wait."""

    def __init__(self) -> None:
        super().__init__()
        self.time_s = 100.0
        self.on_wait: Callable[[], None] = lambda: None

    def now(self) -> float:
        return self.time_s

    def wait(self, seconds: float, until: threading.Event) -> None:
        self.on_wait()
        if not until.is_set():
            self.time_s += seconds


@dataclass
class Twin:
    """The physics and the machine in it, and the expected values by independent computation."""

    clock: StillClock
    physics: RobotPhysics
    machine: SimulatedMachine
    config: Path
    truth: Geometry
    commanding: Geometry

    def go(self, pose: Pose) -> None:
        """Moves there, and waits until the end."""
        self.machine.move(pose)
        self.clock.time_s += 10.0

    def joints_for(self, pose: Pose) -> Array:
        """The slider positions of a pose by the controller's geometry."""
        branch = native_layout(HEXAGLIDE_PARAMETERS).read(self.config).branch
        joints: Array = inverse_kinematics(Hexaglide(), self.commanding, branch, PoseBatch.of([pose]))[0]
        return joints

    def ball_at(self, pose: Pose) -> Array:
        """The actual position of the ball, by least squares instead of the simulation's own method."""
        from scipy.optimize import least_squares

        joints = self.joints_for(pose)
        legs = np.array([1.0, 0.0, 0.0])

        def error(numbers: Array) -> Array:
            platform = PoseBatch.of([Pose(*(float(number) for number in numbers))])
            ends = platform.positions[0] + self.truth["B"] @ platform.rotations[0].T
            sliders = self.truth["S"] + joints[:, None] * legs
            return np.asarray(np.linalg.norm(sliders - ends, axis=1) - self.truth["l"], dtype=float)

        found = least_squares(
            error, pose.as_tuple(), x_scale=(1, 1, 1, 0.1, 0.1, 0.1), xtol=1e-15, ftol=1e-15
        )
        assert np.abs(found.fun).max() < 1e-9
        ball: Array = found.x[:3]
        return ball

    def seen(self) -> Array:
        """The displacements at the three gauges, mm."""
        return np.array([self.physics.gauge_displacement(axis) for axis in "xyz"])


MakeTwin = Callable[..., Twin]


@pytest.fixture
def bundled_cell(tmp_path: Path) -> Cell:
    source = bundled_config("simulated-hexaglide")
    for path in source.parent.glob("simulated-hexaglide*.toml"):
        shutil.copy(path, tmp_path)
    return load_cell(tmp_path / source.name)


def served(bundled_cell: Cell, settings: CellSettings) -> SimulatedCell:
    """The simulated devices of these settings, with the config of the bundled cell."""
    return SimulatedCell(settings, (bundled_cell.config_path,))


@pytest.fixture
def make_twin(bundled_cell: Cell) -> MakeTwin:
    def make(home: Pose = HOME, **changes: Any) -> Twin:
        simulation = bundled_cell.settings.simulation
        assert simulation is not None
        changes = STILL | {key.replace("__", "."): value for key, value in changes.items()}
        simulation = changed(simulation, changes)
        config = bundled_cell.config_path
        read = native_layout(HEXAGLIDE_PARAMETERS).read(config)
        clock = StillClock()
        physics = RobotPhysics(Hexaglide(), simulation, clock, read, home)
        machine = SimulatedMachine(Hexaglide(), NATIVE, (config,), physics, clock, home)
        values = simulation.geometry.model_dump()
        truth = hexaglide_geometry(values["S"], values["B"], values["l"])
        return Twin(clock, physics, machine, config, truth, read.geometry)

    return make


@pytest.fixture
def twin(make_twin: MakeTwin) -> Twin:
    return make_twin()


def changed(section: SimulationSettings, changes: dict[str, Any]) -> SimulationSettings:
    values = section.model_dump()
    for key, value in changes.items():
        *heads, last = key.split(".")
        inner = values
        for head in heads:
            inner = inner[head]
        inner[last] = value
    return type(section).model_validate(values)
