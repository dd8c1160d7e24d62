"""Durations of ways, and whether a robot can stand at commands."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.limits.leg_limits import LegLimits
from hexacell.motion.durations import (
    SHORTEST_S,
    SpeedLimits,
    approximate_durations,
    line_duration,
    line_durations,
    shortest_durations,
)
from hexacell.motion.path_check import is_clear, stands_within_limits
from hexacell.motion.trajectory import interpolate_line
from hexacell.robot.model import robot_of

ROBOT = robot_of(load_cell(bundled_config("simulated-hexaglide")))
duration_of = partial(line_duration, Hexaglide(), ROBOT.controller, ROBOT.branch)
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
def test_the_fastest_piece_is_passed_as_fast_as_allowed_and_none_faster(end: Pose) -> None:
    duration_s = duration_of(HOME, end, LIMITS)
    pieces = 24  # of the simulated controller; another number than the durations are found with
    joints, edge = passed(HOME, end, pieces)
    assert joints.max() * pieces / duration_s <= LIMITS.joint * (1.0 + 1e-6)
    assert edge.max() * pieces / duration_s <= LIMITS.edge_mm_s * (1.0 + 1e-6)
    if duration_s == SHORTEST_S:
        return
    joints, edge = passed(HOME, end, 48)
    share = np.maximum(joints / LIMITS.joint, edge / LIMITS.edge_mm_s) * 48 / duration_s
    assert share.max() == pytest.approx(1.0)


def test_a_move_to_where_the_robot_is_has_a_duration_and_poses_out_of_reach_do_not_count() -> None:
    assert duration_of(HOME, HOME, LIMITS) == SHORTEST_S
    line = interpolate_line(PoseBatch.of([HOME]), PoseBatch.of([Pose(10.0, 0.0, 550.0)]), 4)
    joints = np.zeros((5, 6))
    joints[2, 3] = np.nan
    way = joints[:, None], line.positions[:, None, None]
    assert shortest_durations(*way, SpeedLimits(1.0, 10.0)) == pytest.approx(1.0)


def test_a_way_with_one_fast_piece_is_slow_as_a_whole() -> None:
    """A controller that is told a duration passes all pieces in the same time."""
    joints = np.cumsum([np.full(6, step) for step in (0.0, 1.0, 1.0, 10.0, 1.0)], axis=0)
    still = np.zeros((5, 1, 1, 3))
    assert shortest_durations(joints[:, None], still, SpeedLimits(5.0, 1.0)) == pytest.approx(
        4 * 10.0 / 5.0
    )


def test_durations_by_the_ends_alone_are_near_those_of_the_whole_way() -> None:
    random = np.random.default_rng(3)
    turns = random.uniform(-20.0, 20.0, (40, 3))
    poses = [Pose(0.0, 0.0, 550.0, *turn) for turn in turns.tolist()]
    batch, home = PoseBatch.of(poses), PoseBatch.of([HOME])
    joints, at_home = (Hexaglide().inverse(ROBOT.controller, ROBOT.branch, one) for one in (batch, home))
    start, ends = (home, at_home), (batch, joints)
    about = approximate_durations(Hexaglide(), ROBOT.controller, start, ends, LIMITS)
    exact = np.array([duration_of(HOME, pose, LIMITS) for pose in poses])
    assert (about < 1.01 * exact).all()
    assert (about > 0.55 * exact).all()
    assert np.mean(about / exact) > 0.8
    several = line_durations(Hexaglide(), ROBOT.controller, ROBOT.branch, home[[0] * 40], batch, LIMITS)
    assert several == pytest.approx(exact)


COMMANDS = PoseBatch.of(
    [
        Pose(0, 0, 550),
        Pose(40, -50, 560, 25, 10, 5),
        Pose(0, 0, 899),
        Pose(100, 80, 480, -20, 0, 90),
        Pose(0, 0, 550, 12),
    ]
)
"""The third is out of reach."""


def one(row: int) -> PoseBatch:
    return COMMANDS[np.array([row])]


@pytest.mark.parametrize("sigma", [0.01, 0.05, 2.0])
@pytest.mark.parametrize("margin", [0.05, 0.4, 5.0])
@pytest.mark.parametrize("certainly", [False, True])
def test_many_commands_are_judged_as_each_of_them_is(know, paper, limits, sigma, certainly, margin):
    level = know(paper.nominal)
    legs = level.mechanism.legs(level.estimate, one(0), level.commanded.joints(one(0)))
    wide, narrow = np.full(6, np.pi), np.full(6, np.radians(20.0))
    base, platform = legs.directions[0], (legs.directions @ legs.rotations)[0]
    cones = LegLimits(base, platform, wide, narrow, distance_mm=0.0)
    tight = replace(limits, legs=cones, singularity_margin=margin)
    known = know(paper.nominal, sigma, limits=tight)
    together = stands_within_limits(known, COMMANDS, certainly=certainly)
    for row in range(len(COMMANDS)):
        actual = known.commanded.actual_poses(one(row))
        wanted = known.margins_at(actual)[0] if certainly and actual.found[0] else None
        kept = actual.found[0] and known.keeps_limits(actual.poses, actual.joints, wanted)[0]
        assert together[row] == (kept and is_clear(known, one(row), one(row)))


def test_what_is_not_known_of_a_robot_keeps_it_from_its_limits(know, paper, limits):
    """Cones that the robot as estimated just keeps."""
    known, vague = (know(paper.nominal, sigma, limits=limits) for sigma in (0.001, 0.2))
    actual = known.commanded.actual_poses(one(4))
    legs = known.mechanism.legs(known.estimate, actual.poses, actual.joints)
    axes = legs.in_carriers(legs.directions)[0], (legs.directions @ legs.rotations)[0]
    just = LegLimits(*axes, np.full(6, np.radians(1.0)), np.full(6, np.radians(1.0)), distance_mm=0.0)
    for belief, certainly, expected in ((known, True, True), (vague, False, True), (vague, True, False)):
        limited = replace(belief, limits=replace(limits, legs=just))
        assert stands_within_limits(limited, one(4), certainly=certainly)[0] == expected
