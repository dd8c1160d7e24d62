"""From any position of the robot: a checked line, a checked route, or a refusal."""

from __future__ import annotations

from typing import Any

import pytest

from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion import paths as route_module
from procedures.engine.recovery import RecoveryPolicy
from procedures.journal.journal import read_journal
from procedures.run.state import fold
from procedures.steps import events
from procedures.steps.move import Move
from procedures.workflow import sets as path_planning
from procedures.workflow.sets import NoSafePath
from tests.procedures.story import located, next_step

ELSEWHERE = (-60.0, 80.0, 520.0, 12.0, -8.0, 5.0)
INTERRUPTED = events.Interrupted(reason="a power cut", exit_code=130)


def found_at(pose: Any) -> events.Event:
    return located(pose)


def spy(monkeypatch: pytest.MonkeyPatch, *blocked: tuple[float, ...]) -> list[tuple[Any, Any, Any]]:
    """Writes down every line that is checked; those to some poses are not clear."""
    asked: list[tuple[Any, Any, Any]] = []

    def is_clear(_: Any, start: PoseBatch, end: PoseBatch, reference: Any = None) -> bool:
        asked.append((start.pose(0), end.pose(0), reference))
        return not any(end.pose(0).as_tuple() == pytest.approx(pose) for pose in blocked)

    monkeypatch.setattr(route_module, "is_clear", is_clear)
    return asked


def test_a_run_begins_by_locating_the_robot(make_rig) -> None:
    rig = make_rig()
    beginning = [rig.started()]
    assert next_step(rig.calibration, fold(beginning)).key == "locate"
    step = next_step(rig.calibration, fold([*beginning, found_at(ELSEWHERE)]))
    assert step.key == "P1/o01/move"


def test_a_blocked_straight_line_is_replaced_by_a_route_over_a_waypoint(make_rig, monkeypatch) -> None:
    rig = make_rig()
    point = rig.cell.settings.identification.points[0]
    blocked = (*point, 0.0, 0.0, 0.0)
    asked = spy(monkeypatch, blocked)
    state = fold([rig.started(), found_at(ELSEWHERE)])
    with pytest.raises(NoSafePath, match="it was not moved"):
        next_step(rig.calibration, state)
    asked.clear()

    def only_from_level(_: Any, start: PoseBatch, end: PoseBatch, reference: Any = None) -> bool:
        return end.pose(0).as_tuple() != pytest.approx(blocked) or start.pose(0).a == pytest.approx(0.0)

    monkeypatch.setattr(route_module, "is_clear", only_from_level)
    step = next_step(rig.calibration, state)
    assert isinstance(step, Move)
    assert (step.key, step.pose) == ("P1/o00/move", (*ELSEWHERE[:3], 0.0, 0.0, 0.0))
    passed = events.Arrived(at=step.at, orientation=0, pose=step.pose)
    after = fold([rig.started(), found_at(ELSEWHERE), passed])
    assert after.at_pose is None
    assert next_step(rig.calibration, after).key == "P1/o01/move"


def test_a_return_to_the_reference_is_checked_against_the_travel(recording, make_rig, monkeypatch) -> None:
    sampled = recording.until(events.RecordTaken, count=5)
    here = sampled[-1].pose
    asked = spy(monkeypatch)
    step = next_step(make_rig().calibration, fold([*sampled, INTERRUPTED, found_at(here)]))
    assert step.key == "P1/o01/move"
    ((start, end, reference),) = asked
    assert start.as_tuple() == pytest.approx(here)
    assert end == Pose(*sampled[-1].pose[:3]) or end.a == pytest.approx(0.0)
    assert reference is not None


def test_a_robot_away_from_the_ball_returns_on_a_line_checked_without_the_travel(
    recording, make_rig, monkeypatch
) -> None:
    """The gauges' travel cannot be required of a ball that is outside already."""
    sampled = recording.until(events.RecordTaken, count=5)
    asked = spy(monkeypatch)
    step = next_step(make_rig().calibration, fold([*sampled, INTERRUPTED, found_at(ELSEWHERE)]))
    assert step.key == "P1/o01/move"
    assert [reference for *_, reference in asked] == [None]


def test_visited_poses_serve_as_waypoints(recording, make_rig, monkeypatch) -> None:
    sampled = recording.until(events.RecordTaken, count=4)
    state = fold([*sampled, INTERRUPTED, found_at(sampled[-1].pose)])
    second = next(s for s in state.samples(sampled[-1].at.phase) if s.orientation == 2)

    def over_the_second(_: Any, start: PoseBatch, end: PoseBatch, reference: Any = None) -> bool:
        here, there = start.pose(0).as_tuple(), end.pose(0).as_tuple()
        return second.pose in (pytest.approx(here), pytest.approx(there))

    monkeypatch.setattr(route_module, "is_clear", over_the_second)
    step = next_step(make_rig().calibration, state)
    assert (step.key, step.pose) == ("P1/o02/move", second.pose)


async def test_without_a_route_the_run_ends_without_moving(make_rig, monkeypatch) -> None:
    rig = make_rig()
    monkeypatch.setattr(path_planning, "find_route", lambda *_: None)
    policy = RecoveryPolicy.of(rig.cell.settings.recovery, attended=False)
    with pytest.raises(NoSafePath):
        await rig.run(policy=policy)
    assert not any(entry.startswith("move") for entry in rig.controller.log)
    assert [e.failure.value for e in read_journal(rig.folder.journal) if isinstance(e, events.Failed)] == [
        "no_way"
    ]
