"""Robots, calibrations of them and processes that several benchmarks share."""

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from multiprocessing import get_context
from typing import TypeVar

import numpy as np

from hexacell.campaign.planner import Plan
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.checks.check import Check, identified_before
from hexacell.design.search_effort import SearchEffort
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.identification.estimator import identify
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import free_parameter_derivatives
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot, robot_of
from hexacell.robot.virtual_robot import VirtualRobot, random_robot
from tests.benchmarks.figures import Target, at_most

Job = TypeVar("Job")
Outcome = TypeVar("Outcome")

EFFORT = SearchEffort(candidates=128)
STATED_DRIFT_MM = 0.02
"""What the cell file states a parameter may have drifted, one sigma."""

SMALL_SOLVES, REPEATS = 1000, 5
REFERENCE_S = 0.0079
"""What numpy takes for so many small solves where a late decision took 15 ms, 1.9 times as long."""


def on_all_cores(act: Callable[[Job], Outcome], jobs: Iterable[Job], together: int = 1) -> list[Outcome]:
    """What comes of all jobs, in their order, in processes that have all that this one has."""
    cores = len(os.sched_getaffinity(0))
    with ProcessPoolExecutor(cores, mp_context=get_context("fork")) as pool:
        return list(pool.map(act, jobs, chunksize=together))


def reference_seconds() -> float:
    """Numpy's processor time for many solves of a few 6 x 6 systems, the quickest of some repetitions."""
    matrices, values = np.eye(6) + 0.01 * np.ones((12, 6, 6)), np.ones((12, 6, 1))
    taken = []
    for _ in range(REPEATS):
        begun = time.process_time()
        for _ in range(SMALL_SOLVES):
            np.linalg.solve(matrices, values)
        taken.append(time.process_time() - begun)
    return min(taken)


def at_most_here(seconds: float, unit: float = 1.0) -> Target:
    """A target of time, as long as it is on a machine of this one's speed; ``unit`` s is the figure's."""
    return at_most(seconds / unit * reference_seconds() / REFERENCE_S)


def bundled(name: str = "simulated-hexaglide") -> Cell:
    """A cell that comes with the package; its settings cannot be sent to another process."""
    return load_cell(bundled_config(name))


def with_aligned_gauges() -> Cell:
    """The bundled cell with gauges exactly along the axes, as other methods and closed forms have them."""
    cell = bundled()
    stations = cell.settings.stations.model_copy(update={"alignment_deg": 0.0})
    return replace(cell, settings=cell.settings.model_copy(update={"stations": stations}))


def with_gauges_of(travel_mm: float) -> Cell:
    """The bundled cell with gauges of another travel."""
    cell = bundled()
    settings = cell.settings
    gauges = tuple(one.model_copy(update={"travel_mm": travel_mm}) for one in settings.gauges)
    limits = settings.limits.model_copy(update={"gauge_travel_mm": travel_mm / 2.0})
    return replace(cell, settings=settings.model_copy(update={"gauges": gauges, "limits": limits}))


def geometry_of_table_one(cell: Cell) -> Geometry:
    """What the paper identified, in the frames of its table."""
    assert cell.settings.simulation is not None
    values = cell.settings.simulation.geometry.model_dump()
    return Geometry.of(cell.settings.mechanism.parameters, values)


def truth_of(cell: Cell, robot: Robot, number: int) -> Geometry:
    """The robot of Table 1 is number 0; others are drawn within the tolerances. In the convention."""
    if number == 0:
        return robot.mechanism.normalize_frames(geometry_of_table_one(cell))[0]
    random = np.random.default_rng([4, number])
    return random_robot(robot.mechanism, robot.drawing, robot.tolerances, random)


def whole_campaign(cell: Cell, robot: Robot, truth: Geometry, seed: int) -> VirtualCampaign:
    """The records of a calibration, chosen among few poses."""
    plan = Plan(cell.settings, robot, effort=EFFORT, with_forecast=False)
    campaign = VirtualCampaign(plan, VirtualRobot(robot, truth, np.random.default_rng(seed)))
    campaign.carry_out()
    return campaign


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A machine whose controller has an identified geometry, with its covariance (P, P), mm^2."""

    robot: Robot
    covariance: Array

    def check(self, budget: int = 40) -> Check:
        """A check of it, with so many records at most."""
        settings = bundled().settings
        before = identified_before(self.robot, self.covariance, STATED_DRIFT_MM)
        return Check(settings, self.robot, before, budget, effort=EFFORT)

    def built(self, change: Array) -> Geometry:
        """The geometry whose free parameters differ by (p,) from the controller's."""
        convention = self.robot.mechanism.convention
        return convention.geometry(convention.free_parameters(self.robot.commanding) + change)

    @property
    def by_every(self) -> Array:
        """Derivatives (P, p) of the free parameters by all of them."""
        return free_parameter_derivatives(self.robot.mechanism, self.robot.commanding)


@lru_cache
def calibrated() -> Calibrated:
    """The robot of Table 1, calibrated once."""
    cell = bundled()
    robot = robot_of(cell)
    campaign = whole_campaign(cell, robot, truth_of(cell, robot, 0), 1)
    found = identify(robot.problem(campaign.measurements))
    frames = robot.mechanism.normalize_frames(found.geometry)[1]
    # The cell is ideal, and effects cannot be sent to another process.
    known = replace(robot, controller=found.geometry, frames=frames, effects=())
    return Calibrated(known, found.covariance)
