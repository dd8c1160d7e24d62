"""A fixed list of poses: read, and visited in its order where that is safe."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from hexacell.campaign.decisions import CampaignState, Finished, FinishPoint, MeasurePose, StartPoint
from hexacell.campaign.pose_list import PoseList, pose_list_of
from hexacell.campaign.stopping_rules import REFUSALS
from hexacell.errors import FileError
from hexacell.kinematics.pose import Pose
from tests.hexacell.campaign.conftest import TWO_POINTS, at_two_points


@pytest.fixture(scope="module")
def visited(carry_out):
    """The poses of a campaign without pilot poses, which are safe on its robot in their order."""
    return at_both_points(carry_out(at_two_points(noise__revisits=0)))


def at_both_points(taken):
    """The poses of all records."""
    records = taken[-1].state.measurements.records
    return tuple(tuple(r.pose for r in records if r.point == point) for point in (1, 2))


def plan_of(poses, **changes):
    return at_two_points(listed=PoseList(Path("list.csv"), poses), **changes)


def poses_of(taken, point):
    return [
        one.decision.pose
        for one in taken
        if isinstance(one.decision, MeasurePose | StartPoint) and one.decision.point == point
    ]


def test_a_list_that_is_safe_is_visited_in_its_order(visited, carry_out):
    taken = carry_out(plan_of(visited))
    assert len(taken[-1].state.measurements) >= 15
    for point in (1, 2):
        there = poses_of(taken, point)
        in_order = [pose for pose in visited[point - 1] if any(_near(pose, other) for other in there)]
        assert len(in_order) == len(there)
        assert _near(there[0], visited[point - 1][0])
    assert isinstance(taken[-1].decision, Finished)


def test_a_pose_that_is_not_safe_yet_is_postponed(visited, carry_out):
    """The widest pose listed first comes later, when enough is known."""
    reference, *others = visited[0]
    backwards = ((reference, *reversed(others)), visited[1])
    taken = carry_out(plan_of(backwards, noise__revisits=0))
    there = poses_of(taken, 1)
    assert len(there) >= 5
    assert not _near(there[1], others[-1])


def test_a_rejected_pose_is_skipped(campaign, visited):
    plan = plan_of(visited)
    state = campaign[6].state
    first = plan.decide(state)
    second = plan.decide(replace(state, rejections=1))
    assert isinstance(first, MeasurePose)
    if isinstance(second, MeasurePose):
        assert not _near(first.pose, second.pose)
    given_up = plan.decide(replace(state, rejections=REFUSALS + 1))
    assert isinstance(given_up, FinishPoint)


def test_poses_beyond_the_travel_are_never_visited(visited, carry_out):
    steep = tuple(Pose(*TWO_POINTS[0], tilt, 0.0, 0.0) for tilt in (0.0, 30.0, -30.0))
    plan = plan_of((steep, steep))
    taken = carry_out(plan)
    closed = next(one.decision for one in taken if isinstance(one.decision, FinishPoint))
    assert "none of the poses left in the list" in closed.reason


def test_the_first_pose_of_a_point_is_its_reference(visited):
    moved = (Pose(101.0, -99.0, 501.0, 1.0), *visited[0][1:])
    opening = plan_of((moved, visited[1])).decide(CampaignState())
    assert isinstance(opening, StartPoint)
    assert opening.pose == moved[0]


def _near(one, other):
    return max(abs(a - b) for a, b in zip(one.as_tuple(), other.as_tuple(), strict=True)) < 1e-6


@pytest.fixture
def cell(tmp_path, bundled_cell):
    source = bundled_cell
    plan = source.settings.identification.model_copy(update={"points": TWO_POINTS, "poses": "list.csv"})
    return replace(
        source,
        path=tmp_path / "cell.toml",
        settings=source.settings.model_copy(update={"identification": plan}),
    )


def write(cell, rows):
    with (cell.path.parent / "list.csv").open("w") as stream:
        csv.writer(stream).writerows([["point", "orientation", *"xyzabc", "remark"], *rows])


def row(point, orientation, a=0.0):
    return [point, orientation, *TWO_POINTS[0], a, 0, 0, "as it was"]


def test_a_list_is_read_beside_its_cell_file(cell):
    write(cell, [row(1, 1), row(2, 5), row(1, 2, 3.5), row(2, 7, -2.0)])
    listed = pose_list_of(cell)
    assert listed is not None
    assert len(listed) == 4
    assert [pose.a for pose in listed.at(1)] == [0.0, 3.5]
    assert [pose.a for pose in listed.at(2)] == [0.0, -2.0]


def test_a_list_needs_the_columns_of_poses_only(cell):
    (cell.path.parent / "list.csv").write_text("point,orientation,x,y,z,a,b\n1,1,0,0,550,0,0\n")
    with pytest.raises(FileError, match=r"list\.csv:1: columns are missing: c\. .*x,y,z,a,b,c$"):
        pose_list_of(cell)
