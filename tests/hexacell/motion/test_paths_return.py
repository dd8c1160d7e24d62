"""The next move back to the reference: on the path planned once, or else along the trail."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion import paths
from hexacell.motion.paths import next_return_move

TRAIL = [Pose(0, 0, 500, angle) for angle in (0, 5, 10, 15)]
WAYPOINT = Pose(1, 2, 500, 7, 3, 0)


@pytest.fixture
def plan(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Stands in for the planner and the check of lines: straight lines are clear to some angles only."""

    def planned(*waypoints: Pose, found: bool = True, clear_to: tuple[int, ...] = ()) -> list[float]:
        asked: list[float] = []

        def planner(_: Any, start: PoseBatch, *__: Any) -> Any:
            asked.append(start.pose(0).a)
            return SimpleNamespace(plan=lambda _: [SimpleNamespace(waypoints=waypoints) if found else None])

        monkeypatch.setattr(paths, "PathPlanner", planner)
        monkeypatch.setattr(paths, "is_clear", lambda _, __, end, ___: round(end.pose(0).a) in clear_to)
        return asked

    return planned


def move(trail: list[Pose], departure: int) -> int | Pose:
    nothing: Any = None
    return next_return_move(nothing, np.zeros(3), PoseBatch.of(trail), departure)


def test_straight_to_the_reference_where_that_is_safe(plan: Any) -> None:
    plan()
    assert move(TRAIL, 3) == 0


def test_over_the_waypoints_of_the_path_and_then_to_the_reference(plan: Any) -> None:
    asked = plan(WAYPOINT)
    assert move(TRAIL, 3) == WAYPOINT
    assert move([*TRAIL, WAYPOINT], 3) == 0
    assert asked == pytest.approx([15.0, 15.0]), "planned from the last pose that was measured"


def test_without_a_path_to_the_earliest_pose_that_is_clear(plan: Any) -> None:
    plan(found=False, clear_to=(5, 10))
    assert move(TRAIL, 3) == 1


def test_without_any_clear_line_back_along_the_trail(plan: Any) -> None:
    plan(found=False)
    assert move(TRAIL, 3) == 2


def test_off_the_planned_path_the_robot_returns_along_the_trail(plan: Any) -> None:
    plan(WAYPOINT, clear_to=(0,))
    assert move([*TRAIL, Pose(0, 0, 500, 20)], 3) == 0
    plan(WAYPOINT)
    assert move([*TRAIL, Pose(0, 0, 500, 20)], 3) == 3
