"""Plans of small cells, and campaigns that carry them out on the paper's robot without hardware."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState, Decision, Finished, FinishPoint
from hexacell.campaign.planner import Plan
from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.measuring import AcceptanceSettings
from hexacell.checks.check import Check, identified_before
from hexacell.config.layout import ConfigLayout
from hexacell.design.candidate_refinement import QUICK
from hexacell.design.search_effort import SearchEffort
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.kinematics.geometry import Geometry
from hexacell.robot.model import Robot, make_robot
from hexacell.robot.virtual_robot import VirtualRobot

FEW = SearchEffort(candidates=64, dry_run_robots=1, rounds=QUICK)
TWO_POINTS = ((100.0, -100.0, 500.0), (-100.0, 100.0, 500.0))
MakePlan = Callable[..., Plan]


def at_two_points(**changes: Any) -> Plan:
    """The plan with two points of eight orientations, with changes."""
    return make(**{"identification__points": TWO_POINTS, "identification__orientations": 8} | changes)


def make(**changes: Any) -> Plan:
    """The plan of the demo's cell with changes, ``section__key=value``, that chooses among few poses."""
    cell = load_cell(bundled_config("simulated-hexaglide"))
    settings = cell.settings
    listed = changes.pop("listed", None)
    changes = {"identification__provisional": False} | changes
    for name, value in changes.items():
        section, _, key = name.partition("__")
        inner = getattr(settings, section).model_copy(update={key: value})
        settings = settings.model_copy(update={section: inner})
    controller = ConfigLayout.of(settings).read(cell.config_path)
    return Plan(settings, make_robot(settings, controller), listed, FEW)


def calibrated_to(robot: Robot, geometry: Geometry) -> Robot:
    """The robot with this geometry in its controller."""
    normal, frames = robot.mechanism.normalize_frames(geometry)
    return replace(robot, controller=normal, frames=frames)


def check_of(
    plan: Plan, truth: Geometry, known_mm: float | None, *, budget: int = 40, drift_mm: float = 0.02
) -> Check:
    """A check of a robot that was calibrated, so that each parameter is known to ``known_mm``; or not."""
    robot, before = plan.robot, None
    if known_mm is not None:
        robot = calibrated_to(robot, truth)
        covariance = known_mm**2 * np.eye(len(robot.mechanism.parameters))
        before = identified_before(robot, covariance, drift_mm)
    limits = AcceptanceSettings(position_mm=0.15, orientation_deg=0.05, guard_band_factor=1.0)
    settings = plan.settings.model_copy(update={"acceptance": limits})
    return Check(settings, robot, before, budget, effort=SearchEffort(candidates=32))


def measured_by(plan: Plan, truth: Geometry, random: np.random.Generator) -> CampaignState:
    """The end of a campaign in which the ball never left the travel."""
    virtual = VirtualRobot(plan.robot, truth, random)
    campaign = VirtualCampaign(replace(plan, with_forecast=False), virtual)
    campaign.carry_out()
    assert campaign.outside == 0
    return campaign.state


@dataclass(frozen=True)
class Taken:
    """A decision, and the state that it was made in."""

    state: CampaignState
    decision: Decision


@dataclass(eq=False)
class Campaign:
    """Carries out all decisions of a plan, with noise of 0.01 mm on all readings."""

    plan: Plan
    truth: Geometry
    seed: int = 5

    def run(self, most: int = 200) -> list[Taken]:
        random = np.random.default_rng(self.seed)
        campaign = VirtualCampaign(self.plan, VirtualRobot(self.plan.robot, self.truth, random))
        taken: list[Taken] = []
        while len(taken) < most:
            state, decision = campaign.state, campaign.step()
            if not is_return(self.plan, state, decision):
                taken.append(Taken(state, decision))
            if isinstance(decision, Finished):
                break
        return taken


def is_return(plan: Plan, state: CampaignState, decision: Decision) -> bool:
    """Whether a decision to finish only takes the robot back to the reference."""
    return isinstance(decision, FinishPoint) and state.present != plan.reference_pose(decision.point)


@pytest.fixture(scope="session")
def make_plan() -> MakePlan:
    return make


@pytest.fixture(scope="session")
def carry_out(paper: Any) -> Callable[..., list[Taken]]:
    return lambda plan, **options: Campaign(plan, paper.actual).run(**options)


@pytest.fixture(scope="session")
def two_points() -> Plan:
    return at_two_points()


@pytest.fixture(scope="session")
def campaign(two_points: Plan, carry_out: Any) -> list[Taken]:
    """Both points measured as planned."""
    taken: list[Taken] = carry_out(two_points)
    return taken
