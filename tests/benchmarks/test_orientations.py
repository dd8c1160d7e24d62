"""Accuracy with automatically selected orientations, on many robots and through the whole plan.

``ROBOTS`` in the environment says how many random robots are tried besides Table 1's; the targets are
for 1,000. All cores are used.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState, Finished
from hexacell.campaign.planner import Plan
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import Cell, load_cell
from hexacell.errors import HexacellError
from hexacell.identification.estimator import identify
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot, robot_of
from hexacell.robot.virtual_robot import VirtualRobot, random_robot
from tests.geometries import hexaglide_geometry
from tests.simulated_campaign import SimulatedCampaign

Say = Callable[[str, str, str], None]

pytestmark = pytest.mark.benchmark

ROBOTS = int(os.environ.get("ROBOTS", "40"))
PAPER_MM = 0.57
RECORDS_FOR_PAPER = 33
POINTS = 5
LEAST_MARGIN = 0.015
"""Of the real robot on its ways: half of what the estimated one keeps at every record."""

ROBOTS_TIMED = 4
MUST_COST_S = 0.025
"""5 % of a move and settle of the LinuxCNC cell, 0.5 s and more."""


@dataclass(frozen=True)
class Manner:
    """How the robots are measured."""

    tilt_deg: float
    lend: bool


@dataclass(frozen=True)
class Outcome:
    """What came of one robot; ``reason`` where it was refused or failed."""

    error_mm: float = np.nan
    after_33_mm: float = np.nan
    records: int = 0
    outside: int = 0
    margin: float = np.nan
    points: int = 0
    reason: str = ""
    failed: bool = False


def cell_and_robot(tilt_deg: float, lend: bool = False) -> tuple[Cell, Robot]:
    cell = load_cell(bundled_config("simulated-hexaglide"))
    identification = cell.settings.identification.model_copy(update={"provisional": lend})
    settings = cell.settings.model_copy(update={"identification": identification})
    cell, robot = replace(cell, settings=settings), robot_of(cell)
    return cell, replace(robot, limits=replace(robot.limits, tilt=float(np.radians(tilt_deg))))


def truth_of(cell: Cell, robot: Robot, number: int) -> Geometry:
    """Table 1's robot is number 0."""
    if number == 0:
        assert cell.settings.simulation is not None
        actual = cell.settings.simulation.geometry.model_dump()
        return robot.mechanism.normalize_frames(hexaglide_geometry(actual["S"], actual["B"], actual["l"]))[
            0
        ]
    return random_robot(
        robot.mechanism, robot.drawing, robot.tolerances, np.random.default_rng([4, number])
    )


def can_stand_everywhere(cell: Cell, robot: Robot, truth: Geometry) -> bool:
    """Whether the real robot gets to all points level, as its controller would send it there."""
    virtual_robot = VirtualRobot(robot, truth)
    first, *others = (Pose(*point) for point in cell.settings.identification.points)
    try:
        virtual_robot.place(first)
        for point in others:
            virtual_robot.move(point)
    except HexacellError:
        return False
    return virtual_robot.smallest_margin >= robot.limits.singularity_margin


def measured(job: tuple[int, Manner]) -> Outcome:
    number, manner = job
    cell, robot = cell_and_robot(manner.tilt_deg, manner.lend)
    truth = truth_of(cell, robot, number)
    if not can_stand_everywhere(cell, robot, truth):
        return Outcome(reason="cannot stand at all points")
    campaign = SimulatedCampaign(cell.settings, robot, truth, np.random.default_rng([5, number]))
    try:
        campaign.carry_out()
        found = error(campaign, truth, len(campaign.measurements))
    except HexacellError as failure:
        return Outcome(reason=str(failure), failed=True, outside=campaign.outside)
    return Outcome(
        error_mm=found,
        after_33_mm=error(campaign, truth, RECORDS_FOR_PAPER),
        records=len(campaign.measurements),
        outside=campaign.outside,
        margin=campaign.virtual_robot.smallest_margin,
        points=len(np.unique(campaign.measurements.points)),
        reason=campaign.reason,
    )


def error(campaign: SimulatedCampaign, truth: Geometry, records: int) -> float:
    some = MeasurementSet(campaign.measurements.records[:records])
    found = identify(campaign.robot.problem(some))
    return found.geometry.largest_difference(truth)


def outcomes(manner: Manner) -> list[Outcome]:
    jobs = [(number, manner) for number in range(ROBOTS + 1)]
    with ProcessPoolExecutor(mp_context=get_context("fork")) as pool:
        return list(pool.map(measured, jobs, chunksize=1))


def shown(
    say: Say, manner: Manner, found: list[Outcome], targets: tuple[float, float]
) -> tuple[float, float, float]:
    done = [one for one in found if np.isfinite(one.error_mm)]
    errors = np.array([one.error_mm for one in done])
    title = "a lent geometry" if manner.lend else "the unmodified controller"
    median, most = float(np.median(errors)), float(np.quantile(errors, 0.95))
    after = float(np.median([one.after_33_mm for one in done]))
    failed = [one for one in found if one.failed]
    left_out = sum(one.points < POINTS for one in done)
    cannot = len(found) - len(done) - len(failed)
    margin = min(one.margin for one in done)
    say(f"{title}, tilts to {manner.tilt_deg:g} deg: robots", f"{len(found)}", f"{cannot} cannot stand")
    say("  largest parameter error, median", f"{median:.3f} mm", f"at most {targets[0]:g}")
    say("  largest parameter error, 95 % within", f"{most:.3f} mm", f"at most {targets[1]:g}")
    say("  Table 1's robot", f"{found[0].error_mm:.3f} mm", "paper 0.572 with unlimited travel")
    say("  median after 33 records", f"{after:.3f} mm", f"at most {PAPER_MM:g}")
    say("  records", f"{sum(one.records for one in done)}", "11 at each point")
    say("  outside the travel", f"{sum(one.outside for one in found)}", "none")
    say("  smallest singularity margin on the way", f"{margin:.3f}", f"at least {LEAST_MARGIN:g}")
    say("  robots given up, with a point left out", f"{len(failed)}, {left_out}", "none")
    for one in failed:
        say("  given up", "", one.reason)
    assert margin >= LEAST_MARGIN
    return median, most, after


@pytest.mark.parametrize(
    ("manner", "median_mm", "most_mm"),
    [(Manner(45.0, lend=False), 0.25, 0.50), (Manner(60.0, lend=True), 0.15, 0.30)],
    ids=["unmodified controller", "lent geometry"],
)
def test_largest_parameter_error(say, manner, median_mm, most_mm):
    found = outcomes(manner)
    median, most, after = shown(say, manner, found, (median_mm, most_mm))
    assert after <= PAPER_MM
    assert median <= median_mm
    assert most <= most_mm
    assert sum(one.outside for one in found) == 0
    assert not any(one.failed for one in found)


def costs_of(number: int) -> dict[int, float]:
    """What deciding on a pose cost, s, by how many records there were, on one robot."""
    cell, robot = cell_and_robot(45.0)
    truth = truth_of(cell, robot, number)
    campaign = SimulatedCampaign(cell.settings, robot, truth, np.random.default_rng(6))
    costs: dict[int, float] = {}
    plan = Plan(cell.settings, robot)
    while not isinstance(campaign.step(), Finished):
        state: CampaignState = campaign.state
        if state.point is None or len(state.measurements) in costs:
            continue
        if state.records_at(state.point) < cell.settings.identification.orientations:
            begun = time.process_time()
            plan.decide(state)
            costs[len(state.measurements)] = time.process_time() - begun
    return costs


def test_cost_of_choosing_a_pose(say):
    costs = [cost for number in range(ROBOTS_TIMED) for cost in costs_of(number).items()]
    sizes, seconds = np.transpose(costs)
    late = float(np.median(seconds[sizes >= 44]))
    early = float(np.median(seconds[(sizes >= 22) & (sizes < 33)]))
    say(
        "choosing a pose and refitting, at 44 to 54 records",
        f"{1e3 * late:.0f} ms",
        f"below {1e3 * MUST_COST_S:g} ms",
    )
    say("  growth from 27 to 50 records", f"{late / early:.2f} times", "at most 1.85 times")
    assert late / early < 50 / 27 * 1.5
    assert late < MUST_COST_S
