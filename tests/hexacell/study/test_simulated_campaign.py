"""A campaign on a virtual robot with all its moves."""

import numpy as np
import pytest
from scipy.stats import chi2

from hexacell.campaign.decisions import Finished
from hexacell.identification.estimator import identify
from hexacell.kinematics.pose import Pose
from hexacell.robot.model import robot_of
from tests.benchmarks.watched_robot import watch
from tests.simulated_campaign import SimulatedCampaign
from tests.small_cell import changed


@pytest.fixture(
    scope="module",
    params=[pytest.param(False, marks=pytest.mark.slow), True],
    ids=["as drawn", "provisional"],
)
def campaign(request, bundled_cell, paper):
    """A campaign that is carried out, what its robot did, and where each point ended and should."""
    robot = robot_of(bundled_cell)
    truth, _ = robot.mechanism.normalize_frames(paper.actual)
    changes = {"identification.orientations": 6, "identification.provisional": request.param}
    settings = changed(bundled_cell.settings, changes)
    campaign = SimulatedCampaign(settings, robot, truth, np.random.default_rng(5))
    seen = watch(campaign, np.random.default_rng(5)).seen
    ends: dict[int, tuple[Pose, Pose]] = {}
    while not isinstance(campaign.step(), Finished):
        if campaign.state.point is None:
            point = max(campaign.state.done)
            ends.setdefault(point, (campaign.virtual_robot.command, campaign.plan.reference_pose(point)))
    assert campaign.robot.uses_provisional == request.param
    return campaign, seen, ends


def test_a_campaign_measures_all_poses_safely_and_identifies_the_robot(campaign):
    campaign, seen, _ = campaign
    limits = campaign.robot.limits
    assert campaign.reason == "all 5 points are measured"
    assert len(campaign.measurements) == 30
    assert campaign.outside == 0
    assert 0.1 < campaign.largest_mm <= limits.gauge_travel_mm
    assert seen.margin > 0.5 * limits.singularity_margin
    found = identify(campaign.robot.problem(campaign.measurements))
    truth = campaign.virtual_robot.truth
    error = found.free - campaign.robot.mechanism.convention.free_parameters(truth)
    assert error @ np.linalg.solve(found.free_covariance, error) < chi2.ppf(0.999, len(error))
    sigma = np.sqrt(np.diag(found.free_covariance)).max()
    assert sigma < 0.3 * campaign.robot.drawing.largest_difference(truth)


def test_no_command_stop_or_return_is_beyond_a_limit(campaign):
    """Passive joints and legs are those of the real robot, which the program does not know."""
    campaign, seen, _ = campaign
    assert seen.moves > len(campaign.measurements)
    assert 30.0 < seen.tilt <= 45.0 + 1e-6
    assert 30.0 < seen.turn <= 60.0 + 1e-6
    assert seen.axis_is_kept
    assert seen.joint_is_kept
    assert 0.0 <= seen.spare < 5.0
    assert seen.distance_mm >= campaign.robot.limits.legs.distance_mm


def test_every_point_ends_at_its_reference(campaign):
    campaign, _, ends = campaign
    assert set(ends) == campaign.state.done == {1, 2, 3, 4, 5}
    if not campaign.robot.uses_provisional:
        assert all(command == reference for command, reference in ends.values())
