"""What is written to the controller: the same robot, in frames in which taught poses hardly move."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hexacell.cell.loader import Cell
from hexacell.cell.measuring import AcceptanceSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.identification.diagnostics.frame_alignment import PoseErrors
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import FrameTransform, Pose
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.results.written_geometry import TaskDisplacement, as_written
from hexacell.robot.model import Robot, make_robot
from tests.hexacell.conftest import vector

RECALIBRATIONS = 12
WORKSHOP = FrameTransform(
    base=Rotation.from_rotvec([0.4, 0.0, 0.0]).as_matrix(),
    origin=np.array([20.0, -300.0, 150.0]),
    platform=Rotation.from_rotvec([0.2, -0.1, 0.7]).as_matrix(),
)
"""From the paper's frames to those of another config."""


@pytest.fixture(scope="module")
def cell(bundled_cell: Cell) -> Cell:
    return bundled_cell


@pytest.fixture(scope="module")
def taught_with(cell: Cell, paper: Any) -> Callable[[Geometry], Robot]:
    """The robot of the bundled cell, taught with a geometry that its controller still has."""
    return lambda geometry: make_robot(
        cell.settings, ControllerGeometry(geometry, paper.branch), taught=geometry
    )


@pytest.fixture(scope="module")
def estimates(paper: Any, identified: Any) -> list[Geometry]:
    """What calibrations of one robot give: the truth with errors as the noise makes them."""
    convention = Hexaglide().convention
    truth = convention.free_parameters(paper.actual)
    errors = np.random.default_rng(3).multivariate_normal(
        np.zeros(len(truth)), identified.free_covariance, RECALIBRATIONS + 1
    )
    return [convention.geometry(truth + error) for error in errors]


def invariants(geometry: Geometry) -> NDArray[np.float64]:
    """What no choice of frames changes: distances, places along the rails, lengths, all in mm."""
    S, B, lengths = geometry["S"], geometry["B"], geometry["l"]
    between = np.linalg.norm(S[:, None] - S, axis=-1)
    radii = np.linalg.norm(B, axis=-1)
    across = np.linalg.norm(B[:, None] - B, axis=-1)
    along = S[:, None, 0] - S[:, 0]
    return np.concatenate([values.ravel() for values in (between, along, radii, across, lengths)])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31))
def test_what_is_written_is_the_same_robot(cell, paper, taught_with, legs, seed):
    """Its invariants are the same, and where it closes the identified one closes too."""
    random = np.random.default_rng(seed)
    errors = random.uniform(-3.0, 3.0, 35)
    convention = Hexaglide().convention
    identified = convention.geometry(convention.free_parameters(paper.nominal) + errors)
    robot = taught_with(Hexaglide().change_frames(paper.nominal, WORKSHOP))
    written = as_written(cell.settings, robot, identified).geometry
    np.testing.assert_allclose(invariants(written), invariants(identified), atol=1e-9)
    level = np.array([*random.uniform(-50.0, 50.0, 2), 550.0, *random.uniform(-0.1, 0.1, 3)])
    joints = legs(identified).joints(level)
    there = robot.with_controller(written)
    command = there.to_command(Pose.of(level[:3], Rotation.from_rotvec(level[3:]).as_matrix()))
    np.testing.assert_allclose(legs(written).errors(vector(command), joints), 0.0, atol=1e-9)


def moved(estimate: Geometry, taught: Geometry, poses: Any, legs: Any) -> float:
    """How far the farthest of some poses moves at its joint variables, by the leg equations alone, mm."""
    distances = []
    for pose in poses:
        was = vector(Pose(*pose))
        now = legs(estimate).closed(legs(taught).joints(was), was)
        distances.append(np.linalg.norm(now[:3] - was[:3]))
    return float(max(distances))


def test_a_recalibration_of_an_unchanged_robot_moves_the_task_poses_little(
    cell, taught_with, estimates, legs
):
    """Measured: 0.073 mm instead of 0.31 mm at the median, in the convention's frames."""
    here, there = [], []
    for taught, estimate in pairwise(estimates):
        robot = taught_with(taught)
        written = as_written(cell.settings, robot, estimate)
        here.append(moved(written.geometry, taught, cell.settings.task.poses, legs))
        there.append(moved(robot.for_controller(estimate), taught, cell.settings.task.poses, legs))
        assert written.displacement is not None
        assert written.displacement.position_mm == pytest.approx(here[-1], abs=1e-7)
    assert np.median(here) < 0.4 * np.median(there)
    assert max(here) < max(there)


def test_frames_do_not_wander_from_calibration_to_calibration(cell, taught_with, estimates, legs):
    """After a dozen of them, each taught with the one before, the first poses are still where they were."""
    poses = cell.settings.task.poses
    controller = estimates[0]
    for estimate in estimates[1:]:
        controller = as_written(cell.settings, taught_with(controller), estimate).geometry
    direct = as_written(cell.settings, taught_with(estimates[0]), estimates[-1]).geometry
    chained = moved(controller, estimates[0], poses, legs)
    assert chained == pytest.approx(moved(direct, estimates[0], poses, legs), rel=0.05)


def test_the_frames_are_those_of_teaching_whatever_the_controller_has_now(cell, paper, taught_with):
    taught = Hexaglide().change_frames(paper.actual, WORKSHOP)
    robot = replace(taught_with(paper.nominal), taught=taught)
    written = as_written(cell.settings, robot, paper.actual)
    np.testing.assert_allclose(written.geometry.vector, taught.vector, atol=1e-8)


@pytest.mark.parametrize(
    ("mm", "deg", "within"), [(0.15, 0.05, True), (0.16, 0.01, False), (0.01, 0.06, False)]
)
def test_what_moves_by_less_than_the_limits_need_not_be_taught_anew(mm, deg, within):
    errors = PoseErrors(np.array([0.001, mm]), np.radians([deg, 0.001]))
    found = TaskDisplacement.of(errors, AcceptanceSettings(position_mm=0.15, orientation_deg=0.05001))
    assert found is not None
    assert (found.position_mm, found.poses) == (mm, 2)
    assert found.orientation_deg == pytest.approx(deg)
    assert found.is_within_limits is within
    nothing = PoseErrors(np.zeros(0), np.zeros(0))
    assert TaskDisplacement.of(nothing, AcceptanceSettings()) is None


def test_records_of_before_and_after_the_write_back_are_commanded_in_frames_of_their_own(
    cell, paper, taught_with, visit
):
    """Every record is attributed to its geometry, and its pose is in the frames that the solver has."""
    robot = taught_with(paper.nominal)
    written = as_written(cell.settings, robot, paper.actual).geometry
    after = robot.with_controller(written)
    first = visit(seed=2)
    done = [first.measured(), _commanded_with(after, visit(paper.actual, paper.actual, seed=4))]
    records = [
        replace(record, point=record.point + 5 * later)
        for later, measured in enumerate(done)
        for record in measured.records
    ]
    commands = after.problem(MeasurementSet(tuple(records))).commands
    for row, record in enumerate(records):
        np.testing.assert_allclose(commands.joints[row], record.joints, atol=1e-6)
    stated = [geometry.vector for geometry in commands.candidate_geometries]
    for row, expected in ((0, paper.nominal), (len(records) - 1, paper.actual)):
        np.testing.assert_allclose(stated[commands.choice[row]], expected.vector, atol=1e-9)


def _commanded_with(robot: Robot, visits: Any) -> MeasurementSet:
    """The records of visits whose commands are those of a robot in other frames."""
    return MeasurementSet(
        tuple(
            Record(one.point, one.orientation, robot.to_command(one.pose), one.joints, one.deviation)
            for one in visits.measured().records
        )
    )
