"""What all benchmarks share: the cell of Table 1, and a line for each figure."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from tests.geometries import hexaglide_geometry

Say = Callable[[str, str, str], None]


@dataclass(frozen=True)
class TableOne:
    """The robot of Table 1, its hidden geometry, and P1 to P5 of Table 3 (Abtahi et al. 2010)."""

    robot: Robot
    truth: Geometry
    points: Array


@pytest.fixture(scope="session")
def table_one() -> TableOne:
    cell = load_cell(Path(bundled_config("simulated-hexaglide")))
    assert cell.settings.simulation is not None
    values = cell.settings.simulation.geometry.model_dump()
    return TableOne(
        robot_of(cell),
        hexaglide_geometry(values["S"], values["B"], values["l"]),
        np.array(cell.settings.identification.points),
    )


@pytest.fixture(scope="session")
def say() -> Say:
    """Prints a figure beside what it must reach."""

    def line(figure: str, measured: str, target: str) -> None:
        print(f"\n  {figure:<58} {measured:>22}   ({target})", end="")

    return line


@pytest.fixture(scope="session", autouse=True)
def _tracker_of_processes() -> None:
    """A process that Python keeps beside all that it spawns, with a pipe to it."""
    resource_tracker.ensure_running()


@pytest.fixture
def on_one_processor() -> Iterator[None]:
    """For figures that count the processor time of threads: waking another processor counts, too."""
    usual = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(usual)})
    yield
    os.sched_setaffinity(0, usual)
