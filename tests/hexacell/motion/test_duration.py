"""Durations of ways: no piece is passed faster than allowed, and the fastest as fast as allowed."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.motion.trajectory import (
    SHORTEST_S,
    LineDurations,
    SpeedLimits,
    interpolate_line,
    shortest_duration,
)
from hexacell.robot.model import robot_of

ROBOT = robot_of(load_cell(bundled_config("simulated-hexaglide")))
LINES = LineDurations(Hexaglide(), ROBOT.controller, ROBOT.branch)
LIMITS = SpeedLimits(joint=20.0, edge_mm_s=30.0)
HOME = Pose(0.0, 0.0, 550.0)


def passed(start: Pose, end: Pose, pieces: int) -> tuple[Any, Any]:
    """How far the fastest slider and the fastest of ball and platform joints come in each piece, mm."""
    line = interpolate_line(PoseBatch.of([start]), PoseBatch.of([end]), pieces)
    joints = Hexaglide().inverse(ROBOT.controller, ROBOT.branch, line)
    of_platform = np.vstack([np.zeros(3), ROBOT.controller["B"]])
    edge = line.positions[:, None] + of_platform @ np.swapaxes(line.rotations, 1, 2)
    steps = np.linalg.norm(np.diff(edge, axis=0), axis=2).max(axis=1)
    return np.abs(np.diff(joints, axis=0)).max(axis=1), steps


small = st.floats(-20.0, 20.0)


@given(st.builds(Pose, small, small, st.floats(540.0, 560.0), small, small, small))
def test_no_piece_of_a_line_is_passed_faster_than_allowed(end: Pose) -> None:
    duration_s = LINES.of(HOME, end, LIMITS)
    pieces = 24  # of the simulated controller; another number than the durations are found with
    joints, edge = passed(HOME, end, pieces)
    assert joints.max() * pieces / duration_s <= LIMITS.joint * (1.0 + 1e-6)
    assert edge.max() * pieces / duration_s <= LIMITS.edge_mm_s * (1.0 + 1e-6)


@given(st.builds(Pose, small, small, st.floats(540.0, 560.0), small, small, small))
def test_the_fastest_piece_is_passed_as_fast_as_allowed(end: Pose) -> None:
    duration_s = LINES.of(HOME, end, LIMITS)
    if duration_s == SHORTEST_S:
        return
    joints, edge = passed(HOME, end, 48)
    share = np.maximum(joints / LIMITS.joint, edge / LIMITS.edge_mm_s) * 48 / duration_s
    assert share.max() == pytest.approx(1.0)


def test_a_move_to_where_the_robot_is_has_a_duration_too() -> None:
    assert LINES.of(HOME, HOME, LIMITS) == SHORTEST_S


def test_poses_out_of_reach_do_not_count() -> None:
    line = interpolate_line(PoseBatch.of([HOME]), PoseBatch.of([Pose(10.0, 0.0, 550.0)]), 4)
    joints = np.zeros((5, 6))
    joints[2, 3] = np.nan
    assert shortest_duration(joints, line.positions[:, None], SpeedLimits(1.0, 10.0)) == pytest.approx(1.0)


def test_a_way_with_one_fast_piece_is_slow_as_a_whole() -> None:
    """A controller that is told a duration passes all pieces in the same time."""
    joints = np.cumsum([np.full(6, step) for step in (0.0, 1.0, 1.0, 10.0, 1.0)], axis=0)
    still = np.zeros((5, 1, 3))
    assert shortest_duration(joints, still, SpeedLimits(5.0, 1.0)) == pytest.approx(4 * 10.0 / 5.0)
