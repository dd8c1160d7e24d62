"""Pilot records steer the choice of poses at the first point, and count for nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState, StartPoint
from hexacell.campaign.pilots import (
    CAUTION,
    FIRST_PILOT,
    MOST_PILOTS,
    are_counted,
    pilot_number,
    with_pilots,
)
from hexacell.campaign.stopping_rules import StoppingRules
from hexacell.identification.estimator import estimate_online
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.campaign.conftest import Campaign, at_two_points


@pytest.fixture(scope="module")
def at_first(campaign) -> CampaignState:
    """The first reference is recorded, and all pilot poses are visited."""
    found = next(one.state for one in campaign if len(one.state.measurements) == 1)
    assert isinstance(found, CampaignState)
    return found


def before(state: CampaignState, pilots: int) -> CampaignState:
    return replace(state, pilots=state.pilots[:pilots], present=state.measurements.records[0].pose)


def test_they_follow_the_reference_of_their_point(campaign) -> None:
    end = campaign[-1].state
    ids = [record.id for record in end.steering.records]
    assert ids[: 1 + MOST_PILOTS] == [(1, 1), *((1, FIRST_PILOT + number) for number in range(MOST_PILOTS))]
    assert [one for one in ids if one[1] < FIRST_PILOT] == [one.id for one in end.measurements.records]
    assert [pilot_number(orientation) for _, orientation in ids[:3]] == [None, 1, 2]


def test_without_their_reference_they_mean_nothing(campaign) -> None:
    end = campaign[-1].state
    others = MeasurementSet(tuple(one for one in end.measurements.records if one.id != (1, 1)))
    assert with_pilots(others, end.pilots) is others
    assert with_pilots(end.measurements, ()) is end.measurements


def test_they_are_chosen_as_if_the_noise_were_larger_than_stated(two_points, at_first) -> None:
    """What a pose would show is as uncertain as by a robot with so much noise."""
    state = before(at_first, 4)
    cautious = two_points.pilot_pose(state)
    noisier = replace(two_points.robot, noise=two_points.robot.noise.scaled(CAUTION))
    same = replace(two_points, robot=noisier, estimator=None).decide(state)
    assert cautious.pose == same.pose
    assert cautious.orientation == FIRST_PILOT + 4
    assert two_points.decide(state).pose != cautious.pose


def test_there_are_none_where_none_are_wanted(two_points, at_first, campaign, make_plan) -> None:
    assert two_points.pilot_pose(at_first) is None, "all are visited"
    state = before(at_first, 3)
    assert two_points.pilot_pose(replace(state, rejections=1)) is None, "the estimate is misled"
    assert two_points.pilot_pose(CampaignState()) is None
    later = next(one.state for one in campaign if len(one.state.measurements) == 2)
    assert two_points.pilot_pose(replace(later, pilots=())) is None
    assert make_plan(noise__revisits=0).pilot_pose(before(at_first, 0)) is None


def test_a_robot_that_is_well_known_needs_none(make_plan, paper) -> None:
    fine = {f"tolerances__{key}": 0.05 for key in ("S_mm", "B_mm", "l_mm", "ball_mm")}
    plan = make_plan(**fine)
    (start, *_) = Campaign(plan, paper.nominal).run(most=2)
    assert isinstance(start.decision, StartPoint)
    (_, after) = Campaign(plan, paper.nominal).run(most=2)
    assert after.state.pilots == ()


def test_the_first_record_may_turn_far_by_what_they_tell(two_points, at_first) -> None:
    reference = at_first.measurements.records[0].pose
    by_all, by_none = (
        reference.angle_to(two_points.decide(before(at_first, count)).pose) for count in (6, 0)
    )
    assert by_none < np.radians(5.0)
    assert by_all > 2.0 * by_none


def test_the_identification_without_them_is_that_of_the_records_alone(two_points, campaign) -> None:
    end = campaign[-1].state
    estimate = two_points.estimate(end)
    assert not are_counted(estimate.identification.problem).all()
    alone = estimate.of_records_alone()
    anew = estimate_online(two_points.robot.problem(end.measurements))
    assert alone.records == len(end.measurements)
    sigma = np.sqrt(np.diag(anew.free_covariance))
    assert np.abs((alone.free - anew.free) / sigma).max() < 0.01
    without = two_points.estimate(replace(end, pilots=()))
    assert without.of_records_alone() is without.identification


def test_records_that_do_not_determine_the_robot_reach_no_target_with_them(campaign) -> None:
    plan = at_two_points(identification__target_mm=100.0)
    rules: StoppingRules = plan._stopping
    by_records = {len(one.state.measurements): one.state for one in campaign}
    few = next(state for count, state in by_records.items() if count >= 10)
    assert rules.end_of_point(few, few.point or 0) is None, "24 equations of records, 60 with them"
    assert "within 100" in (rules.end_of_point(by_records[15], 2) or "")
