"""The straight line between two commands: checked over its whole length."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import FrameTransform, Pose, PoseBatch
from hexacell.limits.leg_limits import LegLimits
from hexacell.limits.limits import AxisLimits
from hexacell.motion.path_check import LinesFrom, is_clear
from hexacell.motion.trajectory import PIECES, interpolate_line
from tests.hexacell.conftest import NOMINAL, vector
from tests.hexacell.design.conftest import LIMITS, known


def at(*numbers: float) -> PoseBatch:
    return PoseBatch.of([Pose(*numbers)])


def exactly(**change):
    """A robot as drawn, and known exactly."""
    return known(NOMINAL, limits=replace(LIMITS, **change))


def test_all_six_numbers_are_interpolated_linearly_even_over_the_longer_arc() -> None:
    way = interpolate_line(at(0, 0, 500, -10, 0, 40), at(12, -24, 560, 14, 6, -8), pieces=4)
    numbers = [way.pose(row).as_tuple() for row in range(5)]
    np.testing.assert_allclose(numbers[0], (0, 0, 500, -10, 0, 40), atol=1e-9)
    np.testing.assert_allclose(numbers[1], (3, -6, 515, -4, 1.5, 28), atol=1e-9)
    np.testing.assert_allclose(numbers[4], (12, -24, 560, 14, 6, -8), atol=1e-9)
    way = interpolate_line(at(0, 0, 550, 0, 0, 170), at(0, 0, 550, 0, 0, -170), pieces=2)
    assert way.pose(1).c == pytest.approx(0.0, abs=1e-9)


TURNED = FrameTransform(
    Rotation.from_rotvec([0.0, 0.0, 0.2]).as_matrix(),
    np.array([40.0, -15.0, 5.0]),
    Rotation.from_rotvec([0.1, -0.2, 0.8]).as_matrix(),
)
"""As the frames of a drawing may be to those of the convention."""


def test_lines_are_those_of_the_frames_in_which_the_controller_commands() -> None:
    start, end = at(0, 0, 500, -10, 0, 40), at(12, -24, 560, 14, 6, -8)
    lines = interpolate_line(TURNED.poses(start), TURNED.poses(end), 4, TURNED)
    way = TURNED.inverse().poses(lines)
    for share, row in zip(np.linspace(0.0, 1.0, 5), way.numbers(), strict=True):
        expected = (1.0 - share) * start.numbers()[0] + share * end.numbers()[0]
        np.testing.assert_allclose(row, expected, atol=1e-9)
    start, end = at(0, 0, 550, -20, 15, 30), at(10, -20, 540, 15, -20, 10)
    # The robot's frames are another choice than the controller's, whose line is what is moved on.
    belief = exactly(frames=TURNED)
    checked = LinesFrom(belief, TURNED.poses(start)).check(TURNED.poses(end))
    moved = TURNED.inverse().poses(checked.commands.in_shape(-1))
    np.testing.assert_allclose(moved.numbers(), interpolate_line(start, end).numbers(), atol=1e-9)


def test_a_line_is_clear_in_both_directions_or_in_none():
    ends = [at(0, 0, 550, 10), at(30, 20, 560, -20, 5, 10), at(0, 0, 550, 44), at(20, 0, 899)]
    for start in ends:
        for end in ends:
            assert is_clear(exactly(), start, end) == is_clear(exactly(), end, start)


def test_a_line_through_a_singularity_is_refused_though_both_ends_are_clear(legs, paper):
    """The platform is singular at about 46 deg of A, and has margin again on the other side."""
    low, high = Pose(0, 0, 550, 30), Pose(0, 0, 550, 51)
    for pose in (low, high):
        here = vector(pose)
        assert legs(paper.nominal).margin(legs(paper.nominal).joints(here), here) > 0.02
    limited = exactly(singularity_margin=0.02)
    assert not is_clear(limited, at(*low.as_tuple()), at(*high.as_tuple()))
    assert is_clear(limited, at(*low.as_tuple()), at(0, 0, 550, 41))


@pytest.mark.parametrize("start", np.arange(11.5, 17.5, 0.5))
def test_a_singularity_between_two_samples_is_detected(start):
    """With a small limit and long pieces the margin alone may step over it."""
    assert 3.0 * PIECES == 36.0
    assert not is_clear(
        exactly(singularity_margin=0.002), at(0, 0, 550, start), at(0, 0, 550, start + 36.0)
    )


def test_the_joint_range_is_checked_along_the_line():
    """Both ends are inside; in the middle, where the platform is highest, no slider is."""
    tight = exactly(joint_min=-480.0, joint_max=480.0)
    low, high = at(0, -50, 600), at(0, 60, 600)
    assert is_clear(exactly(), low, high)
    ends_only = exactly(joint_min=-520.0, joint_max=520.0)
    assert is_clear(ends_only, low, high)
    assert not is_clear(tight, at(0, 0, 600), at(0, 0, 480))


def test_the_line_is_clear_for_the_estimated_robot_too(know, paper):
    """For the controller's geometry the line is clear; the actual robot comes next to a singularity."""
    start, end = at(0, 0, 550), at(0, 0, 550, 32)
    assert is_clear(know(paper.nominal), start, end)
    assert not is_clear(know(paper.actual), start, end)


def test_the_travel_is_checked_along_the_line_around_the_reference_given(know, paper) -> None:
    """A robot with errors: a tilt of 10 deg takes the ball millimetres away from the reference."""
    real = know(paper.actual)
    start, end = at(0, 0, 550), at(0, 0, 550, 0, 0, 20)
    where = np.array([0.0, 0.0, 550.0])
    assert is_clear(exactly(), start, end, where)
    assert is_clear(real, start, end)
    assert not is_clear(real, start, end, where)
    start, end = at(0, 0, 550), at(4, 0, 550)
    assert is_clear(exactly(), start, end, np.array([0.0, 0.0, 550.0]))
    assert is_clear(exactly(), start, end, np.array([4.9, 0.0, 550.0]))
    assert not is_clear(exactly(), start, end, np.array([-1.5, 0.0, 550.0]))
    assert not is_clear(exactly(), start, end, np.array([0.0, 0.0, 555.5]))


@pytest.mark.parametrize(
    ("change", "within", "beyond"),
    [
        ({"tilt": np.radians(20.0)}, (0, 0, 550, 19), (0, 0, 550, 21)),
        ({"turn": np.radians(20.0)}, (0, 0, 550, 0, 0, 19), (0, 0, 550, 0, 0, -21)),
        ({"axes": AxisLimits(highest=(50.0, *(np.inf,) * 5))}, (49, 0, 550), (51, 0, 550)),
        ({"joint_max": np.array([np.inf] * 5 + [530.0])}, (30, 0, 550), (60, 0, 550)),
    ],
    ids=["tilt", "turn", "axis", "joint"],
)
def test_a_line_to_a_command_beyond_a_limit_is_refused(change, within, beyond):
    limited, here = exactly(**change), at(0, 0, 550)
    assert is_clear(limited, here, at(*within))
    assert not is_clear(limited, here, at(*beyond))
    assert is_clear(exactly(), here, at(*beyond))


def cones(degrees, distance=0.0):
    """Of platform joints, about the nominal legs' directions at a level pose."""
    hexaglide, poses = Hexaglide(), at(0, 0, 550)

    def around(geometry, branch):
        legs = hexaglide.legs(geometry, poses, hexaglide.inverse(geometry, branch, poses))
        wide, narrow = np.full(6, np.pi), np.full(6, np.radians(degrees))
        return LegLimits(legs.directions[0], (legs.directions @ legs.rotations)[0], wide, narrow, distance)

    return around


def test_passive_joints_stay_in_their_cones_along_the_line(paper):
    limited = exactly(legs=cones(20.0)(paper.nominal, paper.branch))
    assert is_clear(limited, at(0, 0, 550), at(0, 0, 550, 15))
    assert not is_clear(limited, at(0, 0, 550), at(0, 0, 550, 22))
    # Both ends are alike far from the middle of the cones, on opposite sides.
    assert is_clear(limited, at(0, 0, 550, 15), at(0, 0, 550, -15))


def test_the_less_is_known_the_more_passive_joints_keep_on_a_way_without_gauges(know, limits, paper):
    """With gauges at the ball the check of the record does the same, robot by robot."""
    limited = replace(limits, legs=cones(20.0)(paper.nominal, paper.branch))
    line = (at(0, 0, 550), at(0, 0, 550, 15))
    reference = np.array([0.0, 0.0, 550.0])
    known, vague = (know(paper.nominal, sigma, limits=limited) for sigma in (0.01, 1.0))
    assert is_clear(known, *line)
    assert not is_clear(vague, *line)
    assert is_clear(vague, at(0, 0, 550), at(0, 0, 550, 5))
    assert is_clear(vague, *line, reference) == is_clear(known, *line, reference)


def test_margins_wanted_are_four_sigma_of_what_robots_drawn_show(know, limits, paper):
    """Against Monte Carlo: margins of robots drawn from the belief, each moved by its own kinematics."""
    limited = replace(limits, legs=cones(45.0, distance=30.0)(paper.nominal, paper.branch))
    belief = know(paper.nominal, 0.05, limits=limited)
    at_start = belief.commanded.actual_poses(at(0, -30, 560, 5))
    drawn = []
    for free in np.random.default_rng(3).multivariate_normal(belief.free, belief.covariance, size=300):
        robot = replace(belief, free=free)
        actual = robot.commanded.actual_poses(at(0, -30, 560, 5))
        drawn.append(limited.leg_margins(robot.mechanism, robot.estimate, actual.poses, actual.joints)[0])
    expected = belief.least_margins + 4.0 * np.std(drawn, axis=0)
    np.testing.assert_allclose(belief.margins_at(at_start)[0], expected, rtol=0.15)


def test_legs_stay_apart_along_the_line(paper):
    near = exactly(legs=cones(180.0, distance=70.0)(paper.nominal, paper.branch))
    assert is_clear(exactly(), at(0, 0, 550), at(-100, 100, 500))
    assert not is_clear(near, at(0, 0, 550), at(-100, 100, 500))


@pytest.mark.parametrize("limit", ["cone", "tilt"])
def test_a_robot_beyond_a_limit_may_come_back_and_not_go_farther(paper, limit):
    """It was moved there by hand, or its geometry is known better now."""
    change = (
        {"legs": cones(20.0)(paper.nominal, paper.branch)}
        if limit == "cone"
        else {"tilt": np.radians(20.0)}
    )
    limited = exactly(**change)
    assert is_clear(limited, at(0, 0, 550, 26), at(0, 0, 550))
    assert not is_clear(limited, at(0, 0, 550, 26), at(0, 0, 550, 29))
