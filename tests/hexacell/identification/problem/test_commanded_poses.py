"""Commanded poses: under which geometry, in which frames, and the start poses from them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.pose import FrameTransform
from hexacell.measurements.records import MeasurementSet, Record

EXACT_MM = 1e-6
WORKSHOP = FrameTransform(
    base=Rotation.from_rotvec([0.4, 0.0, 0.0]).as_matrix(),
    origin=np.array([120.0, -300.0, 850.0]),
    platform=Rotation.from_rotvec([0.1, -0.2, 0.7]).as_matrix(),
)


def in_frames(measurements, change):
    """The same records as a controller with other frames has them."""
    poses = change.poses(measurements.poses)
    deviations = change.deviations(measurements.deviations)
    return MeasurementSet(
        tuple(
            Record(r.point, r.orientation, poses.pose(row), r.joints, tuple(deviations[row].tolist()))
            for row, r in enumerate(measurements.records)
        )
    )


@pytest.mark.parametrize("controller", ["nominal", "actual"])
def test_records_may_be_older_than_the_last_calibration(paper, visit, make_problem, controller):
    """Commanded under the drawing; by now the controller may have been calibrated."""
    found = identify(make_problem(visit(seed=2).measured(), controller=getattr(paper, controller)))
    assert found.geometry.largest_difference(paper.actual) < EXACT_MM
    assert found.records == 55


def test_a_record_starts_under_the_geometry_that_commanded_it(paper, visit, make_problem):
    """From the calibrated one some old records could not be followed to the drawing they came from."""
    old = visit(degrees=40.0, seed=0).measured(0.01, seed=0)
    assert make_problem(old, controller=paper.actual).has_start_pose.all()
    new = visit(paper.actual, paper.actual, degrees=40.0, seed=0).measured(0.01, seed=0)
    problem = make_problem(new, controller=paper.actual)
    np.testing.assert_allclose(problem.commands.joints, problem.joints, atol=0.1)


def test_old_and_new_records_may_be_in_one_file(paper, visit, make_problem):
    old, new = visit(seed=2).measured(), visit(paper.actual, paper.actual, seed=3).measured()
    both = [r for r in old.records if r.point <= 2] + [r for r in new.records if r.point > 2]
    problem = make_problem(MeasurementSet(tuple(both)), controller=paper.actual, noise=Noise(1e-4, 1e-4))
    found = identify(problem)
    assert found.geometry.largest_difference(paper.actual) < EXACT_MM
    assert found.records == 55


@pytest.mark.parametrize("seed", range(2))
def test_a_calibrated_machine_is_calibrated_again(paper, visit, make_problem, seed):
    """It goes where its drawing cannot follow: the search begins at what commanded it."""
    problem = make_problem(
        visit(paper.actual, paper.actual, degrees=40.0, seed=seed).measured(),
        controller=paper.actual,
        noise=Noise(1e-4, 1e-4),
    )
    assert not problem.commands.solve_poses(problem.prior.centre, problem.joints).found.all()
    assert problem.has_start_pose.all()
    found = identify(problem)
    assert found.geometry.largest_difference(paper.actual) < EXACT_MM
    assert found.records == 55
    assert found.data_faults == ()


def test_the_solver_starts_at_the_provisional_geometry(paper, visit, make_problem):
    """Continuation from it to the drawing fails for many of its records: none is lost for that."""
    before = visit(points=1, orientations=4, degrees=2.0, seed=5).measured()
    after = visit(paper.actual, paper.actual, degrees=55.0, seed=7).measured()
    both = [*before.records, *(record for record in after.records if record.point > 1)]
    problem = make_problem(
        MeasurementSet(tuple(both)), provisional=(paper.actual,), noise=Noise(1e-4, 1e-4)
    )
    lost = ~problem.commands.solve_poses(problem.prior.centre, problem.joints).found
    assert np.count_nonzero(lost) > 10
    assert problem.has_start_pose.all()
    assert identify(problem).geometry.largest_difference(paper.actual) < EXACT_MM


def test_the_controllers_frames_do_not_matter(paper, visit, make_problem):
    """Its origin on the floor, its axes rolled, its platform turned: the machine is the same."""
    measured = visit(seed=2).measured(0.01, seed=1)
    moved = make_problem(
        in_frames(measured, WORKSHOP),
        controller=Hexaglide().change_frames(paper.nominal, WORKSHOP),
        drawing=Hexaglide().change_frames(paper.nominal, WORKSHOP),
    )
    there, here = identify(moved), identify(make_problem(measured))
    assert there.geometry.largest_difference(here.geometry) < EXACT_MM
    np.testing.assert_allclose(there.covariance, here.covariance, atol=1e-7)
    assert there.chi2 == pytest.approx(here.chi2, rel=1e-6)


def test_records_are_sorted_by_point_and_keep_their_labels(visit, make_problem):
    measured = visit(points=3, orientations=5, seed=2).measured()
    order = np.random.default_rng(1).permutation(15)
    problem = make_problem(MeasurementSet(tuple(measured.records[row] for row in order)))
    assert problem.points == 3
    np.testing.assert_array_equal(problem.first_rows, [0, 5, 10])
    by_label = {(r.point, r.orientation): r for r in measured.records}
    for row, (point, orientation) in enumerate(problem.labels.tolist()):
        record = by_label[point, orientation]
        np.testing.assert_array_equal(problem.joints[row], record.joints)
        np.testing.assert_allclose(problem.deviations[row], record.deviation, atol=1e-12)
    assert len(set(problem.labels[:5, 0].tolist())) == 1


def test_keeping_some_records_keeps_the_points_right(visit, make_problem):
    problem = make_problem(visit(points=3, orientations=5, seed=2).measured())
    kept = problem.subset(problem.labels[:, 0] != 2)
    assert kept.points == 2
    np.testing.assert_array_equal(kept.first_rows, [0, 5])
    fewer = problem.subset(problem.labels[:, 1] > 3)
    np.testing.assert_array_equal(fewer.first_rows, [0, 2, 4])
    ones = np.ones((6, 1))
    np.testing.assert_array_equal(fewer.group_sums(ones), [[2], [2], [2]])
    np.testing.assert_array_equal(
        fewer.per_record(np.array([[1], [2], [3]])), [[1], [1], [2], [2], [3], [3]]
    )
