"""What all benchmarks share: the cell of Table 1, and the figures that they give."""

import os
from collections.abc import Generator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path

import numpy as np
import pytest

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from tests.benchmarks.figures import DID_NOT_END, Figures
from tests.benchmarks.machines import geometry_of_table_one, with_aligned_gauges

MISSED = pytest.StashKey[Figures]()


@dataclass(frozen=True)
class TableOne:
    """The robot of Table 1, its hidden geometry, and P1 to P5 of Table 3 (Abtahi et al. 2010)."""

    robot: Robot
    truth: Geometry
    points: Array


@pytest.fixture(scope="session")
def table_one() -> TableOne:
    cell = with_aligned_gauges()
    points = np.array(cell.settings.identification.points)
    return TableOne(robot_of(cell), geometry_of_table_one(cell), points)


@pytest.fixture
def figure(request: pytest.FixtureRequest) -> Figures:
    """Prints and keeps a figure beside what it must reach."""
    figures: Figures = request.node.stash[MISSED]
    return figures


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    file = Path(os.environ["HEXACELL_FIGURES"]) if "HEXACELL_FIGURES" in os.environ else None
    item.stash[MISSED] = Figures(item.nodeid, item.path.stem.removeprefix("test_"), [], file)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None]:
    """Targets are judged when a benchmark is over, so that one that is missed hides no other figure."""
    yield
    if missed := item.stash[MISSED].missed:
        pytest.fail("missed: " + "; ".join(missed), pytrace=False)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """One that ends otherwise, or is skipped, is no figure less: the file says so."""
    report = yield
    figures = item.stash[MISSED]
    if not report.passed and call.excinfo is not None and not figures.missed:
        words = " ".join(f"{call.excinfo.typename}: {call.excinfo.value}".split())
        figures(DID_NOT_END, words[:120])
    return report


@pytest.fixture(scope="session", autouse=True)
def _tracker_of_processes() -> None:
    """A process that Python keeps beside all that it spawns, with a pipe to it."""
    resource_tracker.ensure_running()
