"""How long it takes to choose the next pose: with refit and forecast, at 44 to 54 records.

Times are of the processor, the quickest of some repeats. What must hold on any machine is the ratio to
numpy's time for many small solves.
"""

import copy
import time
from dataclasses import replace

import numpy as np

from hexacell.campaign.decisions import CampaignState, Decision, Finished, MeasurePose
from hexacell.campaign.online_estimate import OnlineEstimator
from hexacell.campaign.planner import Plan
from hexacell.dry_run.campaign import VirtualCampaign
from hexacell.kinematics.pose import PoseBatch
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import robot_of
from hexacell.robot.virtual_robot import VirtualRobot
from tests.benchmarks.figures import at_most
from tests.benchmarks.machines import bundled, reference_seconds
from tests.benchmarks.virtual_calibration import robot_that_reaches

LATE = range(44, 55)
REPEATS = 5
MOST_REFERENCES = 1.9

Moment = tuple[Plan, CampaignState, MeasurePose]
"""A plan, a state, and what was decided."""


def late_moments() -> list[Moment]:
    """Of a whole campaign."""
    cell = bundled()
    robot, random = robot_of(cell), np.random.default_rng(1)
    virtual = VirtualRobot(robot, robot_that_reaches(cell, robot, random), random)
    running = VirtualCampaign(Plan(cell.settings, robot, with_forecast=False), virtual)
    moments: list[Moment] = []
    decision: Decision | None = None
    while not isinstance(decision, Finished):
        plan, state = running.plan, running.state
        decision = running.step()
        if isinstance(decision, MeasurePose) and len(state.measurements) in LATE:
            moments.append((plan, state, decision))
    return moments


def seconds_of(moment: Moment) -> float:
    """The quickest of some repetitions of a decision, each with the estimate before the last record."""
    plan, state, decided = moment
    estimator = OnlineEstimator(plan.robot)
    estimator.estimate(MeasurementSet(state.steering.records[:-1]))
    taken = []
    for _ in range(REPEATS):
        again = replace(plan, estimator=copy.copy(estimator).estimate, with_forecast=True)
        _ = again.task, again.budget, again.planned_sets, again.systematic_mm  # made once in a campaign
        begun = time.process_time()
        decision = again.decide(state)
        taken.append(time.process_time() - begun)
        assert isinstance(decision, MeasurePose)
        assert decision.forecast is not None
        assert PoseBatch.of([decision.pose]).is_same(PoseBatch.of([decided.pose])).all()
    return min(taken)


def test_a_late_decision(figure) -> None:
    # The reference right after each decision: a machine that others use is not always as fast.
    timed = np.array([(seconds_of(moment), reference_seconds()) for moment in late_moments()])
    multiple = float(np.median(timed[:, 0] / timed[:, 1]))
    figure("a decision at 44 to 54 records", 1e3 * float(np.median(timed[:, 0])), "ms")
    figure("as a multiple of 1,000 small solves", multiple, "", at_most(MOST_REFERENCES))
