"""The computed path of a robot is the one it takes while its controller follows straight lines."""

import numpy as np
import pytest

from hexacell.design.candidates import orientations
from hexacell.kinematics.forward import continue_solution, forward_kinematics, modes_of
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion import trajectory as module
from hexacell.motion.trajectory import interpolate_lines, trace_path

START = PoseBatch.of([Pose(0, 0, 550)])
TURNS = orientations(64, np.radians(60.0), seed=3)


@pytest.fixture
def commanded(hexaglide, paper):
    """Lines from the first point to many orientations that the controller can reach, and their joints."""
    ends = PoseBatch.at([10.0, -20.0, 540.0], TURNS)
    ways = interpolate_lines((START, ends))
    joints = hexaglide.inverse(paper.nominal, paper.branch, ways.in_shape(-1)).reshape(-1, len(ends), 6)
    rows = np.flatnonzero(np.isfinite(joints).all(axis=(0, 2)))
    return ways[:, rows], joints[:, rows]


@pytest.fixture
def here(hexaglide, paper, commanded):
    _, joints = commanded
    return continue_solution(
        hexaglide,
        paper.actual,
        joints[0, :1],
        start=START,
        start_geometry=paper.nominal,
        start_joints=joints[0, :1],
    ).poses


def stepwise(hexaglide, geometry, ways, joints, here, row, fineness=4):
    """One line in much smaller steps, one after the other; none where the assembly mode is left."""
    mode = modes_of(hexaglide, geometry, here, joints[0, [row]])
    pose, found = here, []
    for piece in range(len(joints) - 1):
        for share in np.arange(1, fineness + 1) / fineness:
            now = (1.0 - share) * joints[piece, [row]] + share * joints[piece + 1, [row]]
            reached = forward_kinematics(hexaglide, geometry, now, pose, mode=mode)
            if not reached.found[0]:
                return None
            pose = reached.poses
        found.append(pose.positions[0])
    return np.array(found)


def test_lines_corrected_at_once_are_those_tracked_step_by_step(hexaglide, paper, commanded, here):
    ways, joints = commanded
    actual, found = trace_path(hexaglide, paper.actual, ways, joints, here)
    agreeing = 0
    for row in range(joints.shape[1]):
        slowly = stepwise(hexaglide, paper.actual, ways, joints, here, row)
        if found[row]:
            assert slowly is not None
            np.testing.assert_allclose(actual.positions[1:, row], slowly, atol=1e-3)
            agreeing += 1
        else:
            assert slowly is None
    assert agreeing > 20
    assert agreeing < joints.shape[1]  # some lines lead into a singularity


def test_unconfirmed_lines_are_tracked_point_by_point_or_left_out(
    hexaglide, paper, commanded, here, monkeypatch
):
    ways, joints = commanded
    sure, is_sure = trace_path(hexaglide, paper.actual, ways, joints, here)
    monkeypatch.setattr(module._Robot, "confirm", lambda *_: False)
    monkeypatch.setattr(module, "JUMP_MM", 0.0)
    doubted, found = trace_path(hexaglide, paper.actual, ways, joints, here)
    np.testing.assert_array_equal(found, is_sure)
    np.testing.assert_allclose(doubted.positions[:, is_sure], sure.positions[:, is_sure], atol=1e-3)
    assert not trace_path(hexaglide, paper.actual, ways, joints, here, thorough=False)[1].any()


def test_a_jump_to_another_solution_is_not_a_path(hexaglide, paper, commanded, here, monkeypatch):
    """Poses of another assembly mode within a line, as a search that left its branch would give."""
    ways, joints = commanded
    sure, is_sure = trace_path(hexaglide, paper.actual, ways, joints, here)
    honest = module._Robot.correct
    asked = []

    def jumping(robot, joints, start):
        poses, found = honest(robot, joints, start)
        asked.append(len(joints))
        if len(asked) == 1:
            turned = poses.rotations.copy()
            turned[5:] = turned[5:] @ PoseBatch.of([Pose(0, 0, 0, 0, 0, 120)]).rotations[0]
            return PoseBatch(poses.positions + np.array([0.0, 0.0, 1.0]), turned), found
        return poses, found

    monkeypatch.setattr(module._Robot, "correct", jumping)
    repaired, found = trace_path(hexaglide, paper.actual, ways, joints, here)
    assert len(asked) > 1
    np.testing.assert_array_equal(found, is_sure)
    np.testing.assert_allclose(repaired.positions[:, is_sure], sure.positions[:, is_sure], atol=1e-3)


def test_lines_go_from_waypoint_to_waypoint():
    stop, end = PoseBatch.of([Pose(0, 0, 560, 10)]), PoseBatch.of([Pose(10, 0, 550, 0, 10, 0)])
    way = interpolate_lines((START, stop, end), refinement=2)
    pieces = len(way) - 1
    assert pieces == 4 * module.PIECES_BETWEEN_WAYPOINTS
    passed = [way[:, 0].pose(row).as_tuple() for row in (0, pieces // 2, pieces)]
    np.testing.assert_allclose(passed, [p.pose(0).as_tuple() for p in (START, stop, end)], atol=1e-9)
