"""From any position of the robot: a checked line, a checked route, or a refusal; and the way back."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexacell.campaign.stopping_rules import REFUSALS
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion import paths
from hexacell.motion.trajectory import interpolate_line
from procedures.run.keys import Phase
from procedures.run.state import fold
from procedures.steps import events
from procedures.steps.move import Move
from procedures.workflow import sets as path_planning
from procedures.workflow.points import IdentificationSteps
from procedures.workflow.sets import NoSafePath
from tests.procedures.runs.listening import happened
from tests.procedures.story import located, next_step

ELSEWHERE = (-60.0, 80.0, 520.0, 12.0, -8.0, 5.0)
INTERRUPTED = events.Interrupted(reason="a power cut", exit_code=130)


def spy(monkeypatch: pytest.MonkeyPatch, *blocked: tuple[float, ...]) -> list[tuple[Any, Any, Any]]:
    """Writes down every line that is checked; those to some poses are not clear."""
    asked: list[tuple[Any, Any, Any]] = []

    def is_clear(_: Any, start: PoseBatch, end: PoseBatch, reference: Any = None) -> bool:
        asked.append((start.pose(0), end.pose(0), reference))
        return not any(end.pose(0).as_tuple() == pytest.approx(pose) for pose in blocked)

    monkeypatch.setattr(paths, "is_clear", is_clear)
    return asked


def test_a_blocked_straight_line_is_replaced_by_a_route_over_a_waypoint(make_rig, monkeypatch) -> None:
    rig = make_rig()
    point = rig.cell.settings.identification.points[0]
    blocked = (*point, 0.0, 0.0, 0.0)
    asked = spy(monkeypatch, blocked)
    state = fold([rig.started(), located(ELSEWHERE)])
    with pytest.raises(NoSafePath, match="it was not moved"):
        next_step(rig.calibration, state)
    asked.clear()

    def only_from_level(_: Any, start: PoseBatch, end: PoseBatch, reference: Any = None) -> bool:
        return end.pose(0).as_tuple() != pytest.approx(blocked) or start.pose(0).a == pytest.approx(0.0)

    monkeypatch.setattr(paths, "is_clear", only_from_level)
    step = next_step(rig.calibration, state)
    assert isinstance(step, Move)
    assert (step.key, step.pose) == ("P1/o00/move", (*ELSEWHERE[:3], 0.0, 0.0, 0.0))
    passed = events.Arrived(at=step.at, orientation=0, pose=step.pose)
    after = fold([rig.started(), located(ELSEWHERE), passed])
    assert after.at_pose is None
    assert next_step(rig.calibration, after).key == "P1/o01/move"


@pytest.mark.parametrize("is_away", [False, True])
def test_a_return_to_the_reference_is_checked_against_the_travel_unless_the_ball_is_away(
    recording, calibration, monkeypatch, is_away
):
    """The gauges' travel cannot be required of a ball that is outside already."""
    sampled = recording.until(events.RecordTaken, count=5)
    here = ELSEWHERE if is_away else sampled[-1].pose
    asked = spy(monkeypatch)
    step = next_step(calibration, fold([*sampled, INTERRUPTED, located(here)]))
    assert step.key == "P1/o01/move"
    ((start, end, reference),) = asked
    assert start.as_tuple() == pytest.approx(here)
    assert end.a == pytest.approx(0.0)
    assert (reference is None) is is_away


def test_visited_poses_serve_as_waypoints(recording, calibration, monkeypatch) -> None:
    sampled = recording.until(events.RecordTaken, count=4)
    state = fold([*sampled, INTERRUPTED, located(sampled[-1].pose)])
    second = next(s for s in state.samples(sampled[-1].at.phase) if s.orientation == 2)

    def over_the_second(_: Any, start: PoseBatch, end: PoseBatch, reference: Any = None) -> bool:
        here, there = start.pose(0).as_tuple(), end.pose(0).as_tuple()
        return second.pose in (pytest.approx(here), pytest.approx(there))

    monkeypatch.setattr(paths, "is_clear", over_the_second)
    step = next_step(calibration, state)
    assert (step.key, step.pose) == ("P1/o02/move", second.pose)


async def test_without_a_route_the_run_ends_without_moving(make_rig, monkeypatch) -> None:
    rig = make_rig()
    monkeypatch.setattr(path_planning, "find_route", lambda *_: None)
    policy = rig.cell.settings.recovery.unattended
    with pytest.raises(NoSafePath):
        await rig.run(policy=policy)
    assert not any(entry.startswith("move") for entry in rig.controller.log)
    assert [one.failure.value for one in happened(rig, events.Failed)] == ["no_way"]


ORIENTATIONS = 9


class ClearLines:
    """Stands in for the check of straight lines: only those to some orientations are clear."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *clear_to: int, stops: tuple[Pose, ...] = ()
    ) -> None:
        self.clear_to = clear_to
        self.stops = stops
        monkeypatch.setattr(IdentificationSteps, "_known", lambda *_: (None, self))
        monkeypatch.setattr(paths, "is_clear", self._is_clear)
        monkeypatch.setattr(paths, "PathPlanner", self._departure)
        self.reference = np.zeros(3)

    def _departure(self, _: Any, start: Any, home: Any, reference: Any) -> Any:
        def plan(end: Any) -> Any:
            clear = self._is_clear(_, start, end, reference)
            return [SimpleNamespace(waypoints=self.stops) if clear else None]

        assert home is None
        return SimpleNamespace(plan=plan)

    def _is_clear(self, _: Any, present: Any, target: Any, reference: Any) -> bool:
        assert reference is self.reference
        # A story's poses differ in their angle a: orientation less one, in degrees.
        return round(target.pose(0).a) + 1 in self.clear_to


@pytest.mark.parametrize(
    ("clear_to", "way"),
    [((1,), [1]), ((4, 1), [1]), ((4,), [4, 3, 2, 1]), ((), [8, 7, 6, 5, 4, 3, 2, 1]), ((6, 5, 2), [2, 1])],
)
def test_the_return_to_the_reference_uses_clear_lines_or_visited_poses(
    calibration, story, monkeypatch, clear_to, way
) -> None:
    ClearLines(monkeypatch, *clear_to)
    happened = story().whole(ORIENTATIONS)[:-2]
    visited: list[int] = []
    while isinstance(step := next_step(calibration, fold(happened)), Move):
        visited.append(step.orientation)
        happened.append(story().arrived(step.orientation, step.pose))
    assert visited == way
    assert step.key == "P1/close"


def test_a_return_path_is_not_planned_again_at_its_waypoint(calibration, story, monkeypatch) -> None:
    """No line is clear from the waypoint; planning from there would go back and forth endlessly."""
    stop = Pose(100.0, -100.0, 500.0, 4.0, 1.0, 0.0)
    stands_in = ClearLines(monkeypatch, 1, stops=(stop,))
    happened = story().whole(ORIENTATIONS)[:-2]
    to_stop = next_step(calibration, fold(happened))
    assert isinstance(to_stop, Move)
    asked: list[float] = []

    def from_the_last_record_only(_: Any, start: Any, home: Any, reference: Any) -> Any:
        asked.append(start.pose(0).a)
        return stands_in._departure(_, start, home, reference)

    monkeypatch.setattr(paths, "PathPlanner", from_the_last_record_only)
    monkeypatch.setattr(paths, "is_clear", lambda *_: False)
    step = next_step(calibration, fold([*happened, story().arrived(0, to_stop.pose)]))
    assert step.key == "P1/o01/move"
    assert asked == pytest.approx([ORIENTATIONS - 1.0])


def test_without_a_clear_line_the_return_visits_the_waypoints_passed_before(
    calibration, story, monkeypatch
):
    ClearLines(monkeypatch)
    stop = (100.0, -100.0, 500.0, 4.0, 1.0, 0.0)
    s = story()
    led = [s.arrived(0, stop), s.arrived(3), s.sampled(3)]
    step = next_step(calibration, fold([*s.whole(2)[:-2], *led, *[s.refused(4)] * (REFUSALS + 1)]))
    assert isinstance(step, Move)
    assert (step.key, step.pose) == ("P1/o00/move", stop)


def test_the_return_from_a_refused_pose_begins_at_the_last_record(calibration, story, monkeypatch) -> None:
    ClearLines(monkeypatch)
    refusals = [story().arrived(5), story().refused(5)] * (REFUSALS + 1)
    step = next_step(calibration, fold([*story().whole(4)[:-2], *refusals]))
    assert step.key == "P1/o04/move"


def test_the_ball_stays_inside_the_travel_on_every_path(recording, make_rig) -> None:
    """Judged by the truth, which the procedure does not know."""
    rig = make_rig()
    robot, truth = rig.calibration.robot, rig.physics._truth
    settings = rig.cell.settings
    here: dict[Any, PoseBatch] = {}
    reference: dict[Any, Any] = {}
    farthest = 0.0
    for event in recording.history:
        if not isinstance(event, events.Arrived) or event.at.phase is not Phase.IDENTIFY:
            continue
        there = PoseBatch.of([Pose(*event.pose)])
        way = interpolate_line(here.get(event.at, there), there)
        joints = inverse_kinematics(robot.mechanism, robot.controller, robot.branch, way)
        really = continue_solution(
            robot.mechanism, truth, joints, start=way, start_geometry=robot.controller, start_joints=joints
        )
        assert really.found.all()
        balls = really.poses.positions
        farthest = max(farthest, np.abs(balls - reference.setdefault(event.at, balls[0])).max())
        here[event.at] = there
    # The estimate that the ways were checked with was a little wrong itself.
    assert 1.0 < farthest < 1.1 * settings.limits.gauge_travel_mm
