"""The plan: which point, which pose and when to stop depend on the records so far only."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hexacell.campaign.decisions import CampaignState, Finished, FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.pilots import MOST_PILOTS
from hexacell.campaign.planner import Plan
from hexacell.campaign.stopping_rules import REFUSALS
from hexacell.cell.limits import PassiveJointSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.design.predicted_records import CHANCE_SIGMAS
from hexacell.robot.model import make_robot
from tests.geometries import hexaglide_geometry
from tests.hexacell.campaign.conftest import TWO_POINTS, at_two_points


def summary(taken):
    """Each decision in a few letters."""
    words = []
    for one in taken:
        match one.decision:
            case StartPoint(point=point):
                words.append(f"R{point}")
            case MeasurePose(point=point, orientation=orientation):
                words.append(f"V{point}.{orientation}")
            case FinishPoint(point=point):
                words.append(f"C{point}")
            case Finished():
                words.append("end")
    return words


def forecasts_of(taken):
    """The forecast of each record."""
    forecasts = [one.decision.forecast for one in taken if isinstance(one.decision, MeasurePose)]
    assert None not in forecasts
    return [forecast for forecast in forecasts if forecast is not None]


def records_of(taken):
    return taken[-1].state.measurements


def test_points_in_order_each_with_its_level_reference_and_all_orientations(campaign):
    visits = [[f"V{point}.{n}" for n in range(2, 9)] for point in (1, 2)]
    assert summary(campaign) == ["R1", *visits[0], "C1", "R2", *visits[1], "C2", "end"]
    assert campaign[-1].decision == Finished("all 2 points are measured")
    opening = campaign[0].decision
    assert opening.pose.as_tuple() == (*TWO_POINTS[0], 0.0, 0.0, 0.0)
    assert np.isfinite(opening.joints).all()


def test_records_are_inside_the_travel_and_as_expected(campaign):
    wrong = []
    for one, following in pairwise(campaign):
        if isinstance(one.decision, MeasurePose):
            visit, record = one.decision, following.state.measurements.records[-1]
            assert (np.abs(visit.deviation) + 3.0 * np.array(visit.sigma)).max() <= 0.9 * 5.0 + 1e-9
            assert np.abs(np.subtract(record.joints, visit.joints)).max() < 0.06
            wrong.append(np.abs(np.subtract(record.deviation, visit.deviation)) / visit.sigma)
    assert np.max(wrong) < 5.0
    assert np.median(wrong) < 1.5


def test_decisions_depend_on_the_state_alone(campaign):
    """Another plan, without memory of what it decided before, decides the same to the last bit."""
    for one in (campaign[3], campaign[12], campaign[6]):
        fresh = at_two_points()
        assert fresh.decide(one.state) == one.decision


def test_the_error_after_each_record_is_as_forecast(campaign):
    """The predicted error after a record, and what then is predicted before the next one."""
    forecasts = forecasts_of(campaign)
    for before, after in pairwise(forecasts[3:7]):
        assert after.now_mm == pytest.approx(before.next_mm, rel=0.1)
    assert forecasts[-1].now_mm < 0.15 * forecasts[0].now_mm
    assert [forecast.records for forecast in forecasts] == [*range(15, 8, -1), *range(7, 0, -1)]
    assert all(forecast.end_mm <= forecast.next_mm <= forecast.now_mm for forecast in forecasts)
    assert forecasts[-1].end_mm == forecasts[-1].next_mm
    # The sets that stand for the poses not chosen yet are those of the drawing.
    assert 0.2 < forecasts[-1].end_mm / forecasts[0].end_mm < 5.0


def test_poses_and_expectations_are_in_the_controllers_frames(campaign, two_points, paper):
    """A config with its base rotated by half a turn about the rails gives the same robot, rotated."""
    turned = np.diag([1.0, -1.0, -1.0])
    geometry = hexaglide_geometry(paper.nominal["S"] @ turned, paper.nominal["B"], paper.nominal["l"])
    robot = make_robot(two_points.settings, ControllerGeometry(geometry, paper.branch))
    points = tuple(tuple((turned @ np.array(point)).tolist()) for point in TWO_POINTS)
    identification = two_points.settings.identification.model_copy(update={"points": points})
    settings = two_points.settings.model_copy(update={"identification": identification})
    plan = Plan(settings, robot, None, two_points.effort)
    opening = plan.decide(CampaignState())
    assert isinstance(opening, StartPoint)
    assert opening.pose.as_tuple()[:3] == points[0]


@pytest.mark.parametrize("rejections", [0, REFUSALS, REFUSALS + 1])
def test_rejections_lead_to_another_pose_until_the_point_is_given_up(campaign, two_points, rejections):
    one = campaign[3]
    decision = two_points.decide(replace(one.state, rejections=rejections))
    if rejections > REFUSALS:
        assert decision == FinishPoint(1, "the ball left the gauges' travel 4 times")
    else:
        assert isinstance(decision, MeasurePose)
        assert (decision.pose == one.decision.pose) == (rejections == 0)


def test_a_point_without_a_safe_pose_is_finished_with_the_reason(campaign, make_plan):
    plan = make_plan(identification__points=TWO_POINTS, limits__gauge_travel_mm=0.02)
    decision = plan.decide(campaign[2].state)
    assert isinstance(decision, FinishPoint)
    assert "inside the gauges' travel" in decision.reason


def test_deviations_keep_to_the_room_that_the_zero_leaves(campaign, two_points):
    """A gauge zeroed near an end of its travel has little room on that side, and no more on the other."""
    state = campaign[3].state
    for zero, lower, upper in (((4.6, 0.0, 0.0), -5.0, 0.4), ((-4.6, 0.0, 0.0), -0.4, 5.0)):
        decision = two_points.decide(replace(state, zero_mm=zero))
        assert isinstance(decision, MeasurePose)
        spread = CHANCE_SIGMAS * decision.sigma[0]
        assert decision.deviation[0] - spread >= 0.9 * lower - 1e-9
        assert decision.deviation[0] + spread <= 0.9 * upper + 1e-9
    free = two_points.decide(state)
    assert abs(free.deviation[0]) + 4.0 * free.sigma[0] > 0.9 * 0.4, "otherwise the sides decide nothing"


def test_a_budget_of_records_ends_the_campaign(carry_out):
    plan = at_two_points(identification__budget_records=11)
    taken = carry_out(plan)
    assert len(records_of(taken)) == 11
    assert summary(taken)[-2:] == ["C2", "end"]
    assert taken[-1].decision == Finished("the budget of 11 records is used")
    assert [forecast.records for forecast in forecasts_of(taken)] == [*range(10, 3, -1), 2, 1]


def test_a_point_is_not_begun_for_a_single_record(campaign):
    plan = at_two_points(identification__budget_records=9)
    between = next(one.state for one in campaign if summary([one]) == ["R2"])
    assert plan.decide(between) == Finished("the budget of 9 records is used")


def test_the_plan_finishes_when_the_target_is_reached(carry_out, campaign):
    errors = forecasts_of(campaign)
    target = 0.5 * sum(one.expanded_mm(one.now_mm) for one in errors[-3:-1])
    plan = at_two_points(identification__target_mm=target)
    taken = carry_out(plan)
    assert len(records_of(taken)) == 14
    assert isinstance(taken[-1].decision, Finished)
    assert taken[-1].decision.reason.startswith("U at the task poses is ")


def test_points_are_chosen_by_their_gain_per_minute(make_plan, carry_out):
    """A point close to one measured already gains little, though it is next in the file."""
    plan = make_plan(
        identification__points=((100.0, -100.0, 500.0), (100.0, -99.0, 500.0), (-100.0, 100.0, 500.0)),
        identification__orientations=8,
        identification__choose_points=True,
        identification__budget_records=14,
        limits__tilt_deg=20.0,  # so that what one point can tell is soon told
    )
    taken = carry_out(plan)
    begun = [one.decision.point for one in taken if isinstance(one.decision, StartPoint)]
    assert 3 in begun[:2]
    assert len(records_of(taken)) == 14


@pytest.mark.slow
def test_points_that_take_long_to_set_up_are_left_later(make_plan, carry_out):
    def plan(minutes):
        return make_plan(
            identification__choose_points=True,
            identification__orientations=30,
            identification__minutes_per_station=minutes,
            limits__tilt_deg=20.0,
            limits__turn_deg=180.0,
            limits__leg_distance_mm=0.0,
            limits__passive_joints=PassiveJointSettings(),
            stations__placement="by-hand",
        )

    taken = carry_out(plan(0.0), most=40)
    left = next(one for one in taken if isinstance(one.decision, FinishPoint))
    assert "gains more in the same time" in left.decision.reason
    assert isinstance(plan(60.0).decide(left.state), MeasurePose)


def test_no_provisional_geometry_before_the_robot_is_known_well_enough(campaign):
    """After two records alone the orientation is uncertain by degrees, too much to command with."""
    plan = at_two_points()
    by_records = {len(one.state.measurements): one.state for one in campaign}
    assert not plan.allows_provisional(CampaignState())
    assert len(by_records[2].pilots) == MOST_PILOTS
    assert not plan.allows_provisional(replace(by_records[2], pilots=()))
    assert plan.allows_provisional(by_records[13])
    assert plan.allows_provisional(campaign[-1].state)


def test_a_point_whose_reference_is_beyond_a_limit_is_left_and_an_uncertain_one_put_off(
    make_plan, carry_out
):
    """No leg is turned by more than 17.6 deg at the references by the drawing, by 23.9 on the robot."""
    narrow = PassiveJointSettings(platform_cone_deg=23.0)
    plan = make_plan(limits__passive_joints=narrow, limits__tilt_deg=20.0, noise__revisits=0)
    taken = carry_out(plan, most=120)
    begun = [one.decision.point for one in taken if isinstance(one.decision, StartPoint)]
    # After point 1 the robot is not known well enough for point 2.
    assert (begun[0], begun[1] in {3, 4}, sorted(begun)) == (1, True, [1, 2, 3, 4])
    assert taken[-1].decision.reason == "none of the remaining points can be reached safely"
    counts = [int((taken[-1].state.measurements.points == point).sum()) for point in range(1, 6)]
    assert sum(counts) == 5 * 17
    assert counts[4] == 0
    assert min(counts[:4]) >= 17, "the others have those of point 5"


def test_a_point_to_which_no_line_is_clear_yet_is_put_off(campaign, make_plan, monkeypatch):
    """With three points, of which the second can be reached from the third only."""
    plan = make_plan(identification__points=(*TWO_POINTS, (0.0, 0.0, 500.0)))
    state = next(one.state for one in campaign if one.state.done == {1})
    assert state.present == plan.reference_pose(1)
    assert _started(plan, state) == 2
    blocked = [(plan.reference_pose(1), plan.reference_pose(2))]
    monkeypatch.setattr(Plan, "route", lambda _, __, *ends: None if ends in blocked else ())
    assert _started(plan, state) == 3
    at_third = replace(state, done=frozenset({1, 3}), present=plan.reference_pose(3))
    assert _started(plan, at_third) == 2
    blocked.append((plan.reference_pose(3), plan.reference_pose(2)))
    assert _started(plan, at_third) == 2, "what the run then says of the way is better than an end"


def _started(plan, state):
    decision = plan.decide(state)
    assert isinstance(decision, StartPoint)
    return decision.point
