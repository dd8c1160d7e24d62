"""Whether a robot can stand at commands: many at once, as the line from each to itself says."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.limits.leg_limits import LegLimits
from hexacell.motion.path_check import is_clear, stands_clear, stands_within_limits

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


@pytest.mark.parametrize("margin", [0.05, 0.4, 5.0])
def test_a_robot_stands_clear_where_the_line_from_there_to_there_is(know, paper, limits, margin):
    limited = replace(limits, singularity_margin=margin, tilt=np.radians(10.0))
    known = know(paper.nominal, limits=limited)
    stands = stands_clear(known, COMMANDS, known.commanded.actual_poses(COMMANDS))
    for row in range(len(COMMANDS)):
        assert stands[row] == is_clear(known, one(row), one(row))


@pytest.mark.parametrize("sigma", [0.01, 0.05, 2.0])
@pytest.mark.parametrize("certainly", [False, True])
def test_many_commands_are_judged_as_each_of_them_is(know, paper, limits, sigma, certainly):
    level = know(paper.nominal)
    legs = level.mechanism.legs(level.estimate, one(0), level.commanded.joints(one(0)))
    wide, narrow = np.full(6, np.pi), np.full(6, np.radians(20.0))
    cones = LegLimits(legs.directions[0], legs.directions_in_platform[0], wide, narrow, distance_mm=0.0)
    known = know(paper.nominal, sigma, limits=replace(limits, legs=cones))
    together = stands_within_limits(known, COMMANDS, certainly=certainly)
    for row in range(len(COMMANDS)):
        actual = known.commanded.actual_poses(one(row))
        wanted = known.margins_at(actual)[0] if certainly and actual.found[0] else None
        kept = actual.found[0] and known.keeps_limits(actual.poses, actual.joints, wanted)[0]
        assert together[row] == (kept and stands_clear(known, one(row), actual)[0])


def test_what_is_not_known_of_a_robot_keeps_it_from_its_limits(know, paper, limits):
    """Cones that the robot as estimated just keeps."""
    known, vague = (know(paper.nominal, sigma, limits=limits) for sigma in (0.001, 0.2))
    actual = known.commanded.actual_poses(one(4))
    legs = known.mechanism.legs(known.estimate, actual.poses, actual.joints)
    axes = legs.directions_in_carriers[0], legs.directions_in_platform[0]
    just = LegLimits(*axes, np.full(6, np.radians(1.0)), np.full(6, np.radians(1.0)), distance_mm=0.0)
    for belief, certainly, expected in ((known, True, True), (vague, False, True), (vague, True, False)):
        limited = replace(belief, limits=replace(limits, legs=just))
        assert stands_within_limits(limited, one(4), certainly=certainly)[0] == expected
