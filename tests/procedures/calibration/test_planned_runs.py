"""A run measures the points and poses that the plan decides, in its order and until its end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from hexacell.campaign.pose_list import PoseList
from hexacell.kinematics.pose import Pose
from procedures.calibration.calibration import campaign_state, expected_records
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.steps import events
from procedures.steps.close import CloseSet
from procedures.steps.move import Move
from tests.procedures.story import next_step


def moves(recording):
    """Moves of the recorded run that were chosen, each with what had happened before."""
    for place, event in enumerate(recording.history):
        if isinstance(event, events.StepBegun) and isinstance(event.step, Move) and event.step.expected:
            yield event.step, recording.history[:place]


def test_every_chosen_move_has_a_forecast_of_its_gain_and_of_the_remaining_records(recording) -> None:
    forecasts = [step.expected.forecast for step, _ in moves(recording) if step.expected]
    assert [forecast.records for forecast in forecasts if forecast] == [*range(17, 9, -1), *range(8, 0, -1)]
    assert all(f and f.end_mm <= f.next_mm <= f.now_mm and f.minutes > 0.0 for f in forecasts)


def test_with_the_target_reached_the_set_is_closed_and_the_geometry_identified(recording, make_rig, story):
    step, before = [*moves(recording)][-2]
    now = step.expected.forecast.now_mm
    assert next_step(make_rig(identification__target_mm=0.99 * now).calibration, fold(before)) is not None
    rig = make_rig(identification__target_mm=1.01 * now)
    back = next_step(rig.calibration, fold(before))
    assert isinstance(back, Move)
    assert back.expected is None
    assert back.orientation < step.orientation
    at_reference = [*before, story(point=2).arrived(1)]
    closing = next_step(rig.calibration, fold(at_reference))
    assert closing == CloseSet(at=step.at, reason=closing.reason)
    assert closing.reason.startswith("the predicted error at the task poses is")
    assert next_step(rig.calibration, fold([*at_reference, story(point=2).closed()])).key == "identify"


def test_the_budget_of_records_ends_the_measurements_between_points(make_rig, story) -> None:
    rig = make_rig(identification__budget_records=10)
    assert next_step(rig.calibration, fold(story().whole(9))).key == "identify"
    assert expected_records(rig.cell.settings, rig.calibration.mode) == 10 + 2 + 2 * 2 * 4 + 2 * 2


def test_chosen_points_keep_their_numbers(make_rig) -> None:
    """Of two points the one with more information is first, whatever its number."""
    far, near = (100.0, -100.0, 500.0), (-100.0, 100.0, 500.0)
    openings = set()
    for points in ((far, near), (near, far)):
        rig = make_rig(identification__points=points, identification__choose_points=True)
        step = next_step(rig.calibration, fold([]))
        assert isinstance(step, Move)
        assert step.pose[:3] == points[step.at.point - 1]
        openings.add(step.pose)
    assert len(openings) == 1


def test_listed_poses_are_run(make_rig, story) -> None:
    rig = make_rig()
    here = tuple(tuple(Pose(*point, n) for n in (0.5, 0.9, 1.2)) for point in ((1.0, 2.0, 500.0),) * 2)
    listed = PoseList(Path("list.csv"), here)
    calibration = replace(rig.calibration, listed=listed)
    step = next_step(calibration, fold([]))
    assert isinstance(step, Move)
    assert step.pose == here[0][0].as_tuple()
    assert expected_records(rig.cell.settings, rig.calibration.mode, listed) == 6 + 2 + 2 * 2 * 4 + 2 * 2
    back = next_step(calibration, fold(story().whole(3)[:-2]))
    assert isinstance(back, Move)
    assert back.orientation < 3
    assert back.expected is None


@pytest.mark.parametrize("order", [(1, 2), (2, 1)])
def test_records_stay_in_the_order_in_which_sets_were_measured(make_rig, story, order) -> None:
    happened = [event for point in order for event in story(point=point).whole(2)]
    situation = campaign_state(fold(happened), None)
    assert situation.measurements.points.tolist() == [point for point in order for _ in range(2)]
    assert situation.done == {1, 2}
    assert fold(happened).samples(Phase.IDENTIFY)[0].at.point == 1
