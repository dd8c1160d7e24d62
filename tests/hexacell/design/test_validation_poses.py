"""Validation poses: commanded through the uncorrected controller, safe, far apart, with clear lines."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.design.candidates import orientations
from hexacell.design.validation_poses import select_validation_poses
from hexacell.errors import LimitError
from hexacell.kinematics.pose import FrameTransform, Pose, PoseBatch
from hexacell.limits.gauge_travel import GaugeTravel
from hexacell.motion.path_check import LinesFrom, ball_position, is_clear
from tests.geometries import hexaglide_geometry
from tests.hexacell.conftest import reached

TRAVEL_MM = 5.0
COUNT = 6
CORNER = np.array([100.0, 100.0, 550.0])
TURNS = orientations(512, float(np.radians(45.0)), seed=2)


@pytest.fixture(scope="module", params=["P6", "corner"])
def point(request, paper):
    return paper.points[5] if request.param == "P6" else CORNER


@pytest.fixture(scope="module")
def chosen(know, much, point):
    return select_validation_poses(know(much), point, COUNT, TURNS)


def test_the_first_pose_is_untilted_and_all_are_at_the_point(chosen, point):
    assert len(chosen) == COUNT
    np.testing.assert_array_equal(chosen.rotations[0], np.eye(3))
    np.testing.assert_array_equal(chosen.positions, np.broadcast_to(point, (COUNT, 3)))


def test_the_uncorrected_robot_keeps_the_ball_inside_the_travel(chosen, paper):
    """The true robot under its uncalibrated controller: what the gauges will show."""
    balls = [reached(paper.actual, paper.nominal, chosen.pose(row))[1][:3] for row in range(COUNT)]
    deviations = np.array(balls) - balls[0]
    assert np.abs(deviations).max() < TRAVEL_MM
    assert np.abs(deviations).max() > 0.5  # and it has something to judge


def test_validation_poses_differ_from_each_other(chosen):
    """As commanded, which is about the actual orientation."""
    turns = Rotation.from_matrix(chosen.rotations)
    apart = [(turns[i] * turns[j].inv()).magnitude() for i in range(COUNT) for j in range(i)]
    assert np.degrees(min(apart)) > 2.0
    assert np.degrees(max(apart)) > 10.0


def test_validation_poses_differ_from_the_orientations_used(chosen, know, much, point, paper):
    """The actual orientations at which the geometry was identified."""
    used = much.poses.rotations
    away = select_validation_poses(know(much), point, COUNT, TURNS, used)
    np.testing.assert_array_equal(away.rotations[0], np.eye(3))

    def nearest(poses):
        stands = [reached(paper.actual, paper.nominal, poses.pose(row))[1][3:] for row in range(1, COUNT)]
        turns = Rotation.from_rotvec(np.array(stands))
        return min((turn * Rotation.from_matrix(used).inv()).magnitude().min() for turn in turns)

    assert np.degrees(nearest(away)) > 3.0
    assert nearest(away) > 1.2 * nearest(chosen)


def test_validation_poses_are_within_the_limits_of_the_corrected_robot(chosen, much, legs):
    corrected = legs(much.geometry)
    for position, rotation in zip(chosen.positions, chosen.rotations, strict=True):
        vector = np.concatenate([position, Rotation.from_matrix(rotation).as_rotvec()])
        joints = corrected.joints(vector)
        assert np.abs(joints).max() <= 800.0
        assert corrected.margin(joints, vector) > 0.05 - 1e-4


def test_lines_from_one_to_the_next_and_back_to_the_first_are_clear(chosen, know, much):
    rows = list(range(COUNT))
    for start, end in [*pairwise(rows), (COUNT - 1, 0)]:
        assert is_clear(know(much), chosen[[start]], chosen[[end]])


def test_on_the_way_the_ball_stays_where_any_mounted_gauge_has_room(know, much, limits, paper):
    """Plungers may stand 2 mm beside the middle of 10 mm: 3 mm are sure to be left, on wide turns too."""
    gauges = GaugeTravel(TRAVEL_MM, (TRAVEL_MM,) * 3, (0.0,) * 3, mounting_mm=2.0)
    belief = know(much, limits=replace(limits, gauges=gauges))
    wide = orientations(512, float(np.radians(70.0)), seed=2)
    chosen = select_validation_poses(belief, paper.points[2], 8, wide)
    reference = ball_position(belief, chosen[[0]])
    assert reference is not None
    rows = list(range(8))
    for start, end in [*pairwise(rows), (7, 0)]:
        way = LinesFrom(belief, chosen[[start]], reference).check(chosen[[end]]).actual.positions
        assert np.abs(way - reference).max() <= 3.0


def test_a_pose_beyond_a_singularity_is_not_selected_though_it_is_farthest(know, paper, limits):
    """Tilted by 51 deg the platform has margin again, in another assembly mode."""
    exactly = know(paper.nominal, limits=replace(limits, singularity_margin=0.02, tilt=1.4))
    centre = np.array([0.0, 0.0, 550.0])
    turns = PoseBatch.of([Pose(0, 0, 0, tilt) for tilt in (5.0, 10.0, 20.0, 35.0, 51.0, -75.0)]).rotations
    taken = select_validation_poses(exactly, centre, 5, turns)
    np.testing.assert_allclose(sorted(taken.numbers()[:, 3]), [0.0, 5.0, 10.0, 20.0, 35.0], atol=1e-9)
    with pytest.raises(LimitError, match="only 5 orientations"):
        select_validation_poses(exactly, centre, 6, turns)


def test_a_point_out_of_reach_is_refused_and_named(know, much):
    with pytest.raises(LimitError, match=r"untilted platform cannot reach X0\.000 Y0\.000 Z900\.000"):
        select_validation_poses(know(much), np.array([0.0, 0.0, 900.0]), COUNT, TURNS)


def test_a_robot_whose_actual_pose_is_not_found_is_refused(know, paper):
    """Its legs are too short for the joint variables that the controller would go to."""
    short = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], paper.nominal["l"] - 150.0)
    with pytest.raises(LimitError, match="cannot be computed"):
        select_validation_poses(know(short), np.array([0.0, 0.0, 450.0]), COUNT, TURNS)


def test_too_few_safe_orientations_are_counted(know, much, limits):
    tight = replace(know(much), limits=replace(limits, gauge_travel_mm=0.2))
    with pytest.raises(LimitError, match=r"only \d+ orientations .* inside the travel"):
        select_validation_poses(tight, CORNER, 40, TURNS[:128])


def test_the_first_pose_is_level_as_the_controller_has_it(know, much, paper):
    """In a config whose platform frame is turned by 8 degrees."""
    turned = Rotation.from_rotvec(np.radians([-8.0, 0.0, 0.0])).as_matrix()
    frames = FrameTransform(np.eye(3), np.zeros(3), turned)
    belief = know(much)
    there = replace(belief, limits=replace(belief.limits, frames=frames))
    commands = frames.inverse().poses(select_validation_poses(there, paper.points[5], 2, TURNS))
    np.testing.assert_allclose(commands.rotations[0], np.eye(3), atol=1e-12)
