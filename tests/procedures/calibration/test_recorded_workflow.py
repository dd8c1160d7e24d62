"""A run measures the points and poses that the plan decides, in its order and until its end."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hexacell.campaign import pose_chooser
from hexacell.campaign.pose_list import PoseList
from hexacell.kinematics.pose import Pose
from hexacell.motion.paths import find_route
from procedures.calibration.calibration import Mode, campaign_state, expected_records
from procedures.run.keys import Phase
from procedures.run.state import apply, fold
from procedures.steps import events
from procedures.steps.close import CloseSet
from procedures.steps.move import Move
from procedures.steps.sample import Sample
from tests.procedures.story import next_step

POINTS, ORIENTATIONS, HELD_OUT = 2, 9, 3


def test_chosen_poses_gain_information_and_show_the_expected_deviations(recording) -> None:
    expected = {
        (event.step.at, event.step.orientation): event.step.expected
        for event in recording.history
        if isinstance(event, events.StepBegun) and isinstance(event.step, Move) and event.step.expected
    }
    assert len(expected) == POINTS * (ORIENTATIONS - 1)
    assert min(one.gain for one in expected.values()) > 0.0
    wrong_by = [
        np.abs(np.subtract(event.deviation_mm, expected[event.at, event.orientation].deviation_mm))
        / expected[event.at, event.orientation].sigma_mm
        for event in recording.history
        if isinstance(event, events.RecordTaken) and (event.at, event.orientation) in expected
    ]
    assert np.max(wrong_by) < 5.0
    assert np.median(wrong_by) < 1.5


@pytest.mark.parametrize("undone", [(4, 2), (2, 4), (3, 4, 2)])
def test_several_records_are_taken_again_one_after_the_other(recording, calibration, undone) -> None:
    """Whatever the order in which they were undone; the robot does not go to one and sample another."""
    sampled = recording.until(events.RecordTaken, count=4)
    taken = {event.orientation: event for event in sampled if isinstance(event, events.RecordTaken)}
    at = taken[1].at
    state = fold([*sampled, *(events.RecordDiscarded(at=at, orientation=number) for number in undone)])
    again = []
    for _ in range(4 * len(undone)):
        match next_step(calibration, state):
            case Move(expected=None, orientation=orientation, pose=pose):
                state = apply(state, events.Arrived(at=at, orientation=orientation, pose=pose))
            case Sample(orientation=orientation, pose=pose):
                assert pose == taken[orientation].pose
                again.append(orientation)
                state = apply(state, taken[orientation])
            case _:
                break
    assert again == list(undone)
    assert not state.set(at).again


def test_after_a_refusal_another_pose_is_chosen(recording, calibration) -> None:
    sampled = recording.until(events.RecordTaken, count=6)
    first = next_step(calibration, fold(sampled))
    assert isinstance(first, Move)
    arrived = events.Arrived(at=first.at, orientation=first.orientation, pose=first.pose)
    refused = events.RecordRejected(at=first.at, orientation=first.orientation, reason="outside")
    second = next_step(calibration, fold([*sampled, arrived, refused]))
    assert isinstance(second, Move)
    assert second.at == first.at
    assert second.orientation in {0, 1, 7}, "there, or on the way there, which may lead over the reference"
    assert second.pose != first.pose


def test_the_path_after_a_refusal_begins_at_the_present_pose(recording, calibration, monkeypatch) -> None:
    """Not at the last record: the refused pose is where the straight lines start that are checked."""
    starts: list[Any] = []

    def spy(belief: Any, start: Any, *others: Any) -> Any:
        starts.append(start.pose(0).as_tuple())
        return find_route(belief, start, *others)

    monkeypatch.setattr(pose_chooser, "find_route", spy)
    sampled = recording.until(events.RecordTaken, count=4)
    refused_at = (101.0, -99.0, 502.0, 4.0, -3.0, 2.0)
    key = sampled[-1].at
    happened = [
        *sampled,
        events.Arrived(at=key, orientation=5, pose=refused_at),
        events.RecordRejected(at=key, orientation=5, reason="outside"),
    ]
    next_step(calibration, fold(happened))
    assert starts[0] == pytest.approx(refused_at)


def test_a_run_takes_the_expected_number_of_records(recording, calibration) -> None:
    came = sum(isinstance(event, events.RecordTaken | events.SetClosed) for event in recording.history)
    assert came == expected_records(calibration.settings, Mode.OPTIMISE)


def test_the_steps_of_a_whole_run_in_their_order(recording) -> None:
    begun = [event.step for event in recording.history if isinstance(event, events.StepBegun)]
    keys = [
        step.key
        for step, following in pairwise([*begun, None])
        if step and not (isinstance(step, Move) and isinstance(following, Move))  # on the way back
    ]

    def of_set(name: str, orientations: int) -> list[str]:
        rest = [
            f"{name}/o{n:02d}/{what}" for n in range(2, orientations + 1) for what in ("move", "sample")
        ]
        begin = [f"{name}/o01/move", f"{name}/place", f"{name}/o01/sample"]
        return [*begin, *rest, f"{name}/o01/move", f"{name}/close"]

    assert keys == [
        "locate",
        *of_set("P1", ORIENTATIONS),
        *of_set("P2", ORIENTATIONS),
        "identify",
        *of_set("before-V1", HELD_OUT),
        *of_set("before-V2", HELD_OUT),
        "propose",
        "commit",
        "locate",
        *of_set("after-V1", 2 * HELD_OUT - 1),
        *of_set("after-V2", 2 * HELD_OUT - 1),
        "judge",
    ]


def moves(recording):
    """Moves of the recorded run that were chosen, each with what had happened before."""
    for place, event in enumerate(recording.history):
        if isinstance(event, events.StepBegun) and isinstance(event.step, Move) and event.step.expected:
            yield event.step, recording.history[:place]


def test_with_the_target_reached_the_set_is_closed_and_the_geometry_identified(recording, make_rig, story):
    step, before = [*moves(recording)][-2]
    now = step.expected.forecast.expanded_mm(step.expected.forecast.now_mm)
    assert next_step(make_rig(identification__target_mm=0.99 * now).calibration, fold(before)) is not None
    rig = make_rig(identification__target_mm=1.01 * now)
    back = next_step(rig.calibration, fold(before))
    assert isinstance(back, Move)
    assert back.expected is None
    assert back.orientation < step.orientation
    at_reference = [*before, story(point=2).arrived(1)]
    closing = next_step(rig.calibration, fold(at_reference))
    assert closing == CloseSet(at=step.at, reason=closing.reason)
    assert closing.reason.startswith("U at the task poses is")
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


def test_listed_poses_are_run(calibration, story) -> None:
    here = tuple(tuple(Pose(*point, n) for n in (0.5, 0.9, 1.2)) for point in ((1.0, 2.0, 500.0),) * 2)
    listed = PoseList(Path("list.csv"), here)
    listing = replace(calibration, listed=listed)
    step = next_step(listing, fold([]))
    assert isinstance(step, Move)
    assert step.pose == here[0][0].as_tuple()
    assert expected_records(calibration.settings, calibration.mode, listed) == 6 + 2 + 2 * 2 * 4 + 2 * 2
    back = next_step(listing, fold(story().whole(3)[:-2]))
    assert isinstance(back, Move)
    assert back.orientation < 3
    assert back.expected is None


@pytest.mark.parametrize("order", [(1, 2), (2, 1)])
def test_records_stay_in_the_order_in_which_sets_were_measured(story, order) -> None:
    happened = [event for point in order for event in story(point=point).whole(2)]
    situation = campaign_state(fold(happened), None)
    assert situation.measurements.points.tolist() == [point for point in order for _ in range(2)]
    assert situation.done == {1, 2}
    assert fold(happened).samples(Phase.IDENTIFY)[0].at.point == 1
