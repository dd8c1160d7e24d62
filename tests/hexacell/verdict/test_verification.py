"""A verdict follows from evidence, accuracy and decision; the true error of a pass is within U."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import Cell
from hexacell.identification.diagnostics.pose_accuracy import error_jacobian
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import Identification
from hexacell.results.result import IdentificationResult
from hexacell.results.written_geometry import as_written
from hexacell.robot.model import Robot, robot_of
from hexacell.services.history.run_index import RunSummary
from hexacell.text.verdict import verification_text
from hexacell.verdict.decision import Verdict
from hexacell.verdict.model_evidence import ZEROS_DOUBTED
from hexacell.verdict.verification import HeldOut, Verification, outcome_line, reason_of, verify
from tests.hexacell.altered_records import later
from tests.hexacell.conftest import reached, visits
from tests.small_cell import changed

NOISE_MM = 0.01
FAR = [(3.0, 2.0, -1.0), (2.0, 2.0, 2.0)]
NEAR = [(0.010, 0.002, -0.004), (0.003, 0.012, 0.002)]


def verified_by(cell: Cell, result: tuple[Robot, Identification], held_out: HeldOut) -> Verification:
    robot, found = result
    return verify(cell.settings, robot, found, held_out)


@pytest.fixture(scope="module")
def cell(bundled_cell):
    return bundled_cell


@pytest.fixture(scope="module")
def result(cell, visit):
    """The robot with the identified geometry as it is written, and the identification."""
    robot = robot_of(cell)
    found = identify(robot.problem(visit(seed=2).measured(NOISE_MM, 1)))
    return robot.with_controller(as_written(cell.settings, robot, found.geometry).geometry), found


def held_out(*machine, before=FAR, after=NEAR, left_travel=False):
    """What three held-out points of six wide poses give, with another machine if one is named."""
    exact = visits(*machine, points=3, orientations=6, seed=7).measured(NOISE_MM, 3)
    return HeldOut(later(exact), before, after, left_travel)


@pytest.fixture
def bent(paper):
    """A machine two of whose legs have other lengths."""
    lengths = paper.actual["l"] + np.array([0.4, 0.0, 0.0, -0.4, 0.0, 0.0])
    return type(paper.actual).of(paper.actual.parameters, {**paper.actual.document(), "l": lengths})


def test_a_good_result_passes_and_its_true_error_is_within_u(cell, result, paper):
    robot, found = result
    verified = verified_by(cell, result, held_out())
    assert verified.verdict is Verdict.PASS
    assert all(test.passed for test in verified.tests)
    assert [test.name for test in verified.tests][:2] == ["residuals", "held-out records"]
    assert verified.accuracy is not None
    position = verified.accuracy.position
    belief = robot.belief(found)
    task = Task.of(cell.settings, robot, belief)
    actual = robot.mechanism.convention.free_parameters(robot.mechanism.normalize_frames(paper.actual)[0])
    errors = error_jacobian(belief, task.poses, task.workspace) @ (found.free - actual)
    true = np.linalg.norm(errors[:, :3], axis=-1).max()
    assert position.expanded is not None
    assert abs(position.value - true) <= position.expanded
    assert 0.02 < position.expanded < 0.16


def turned_in(frames, axes, there, wanted):
    """Errors (2, n, 3) of poses (n, 6) in other frames; a rad counts as 180 mm.

    ``frames`` are a shift, turns about some base axes, and a turn of the platform.
    """
    base = Rotation.from_rotvec(np.eye(3)[["xyz".index(axis) for axis in axes]].T @ frames[3:-3])
    turned = base * Rotation.from_rotvec(there[:, 3:]) * Rotation.from_rotvec(frames[-3:])
    angles = (turned * Rotation.from_matrix(wanted.rotations).inv()).as_rotvec()
    return np.stack([base.apply(there[:, :3]) + frames[:3] - wanted.positions, 180.0 * angles])


@pytest.mark.parametrize("axes", ["", "z", "xyz"])
def test_an_error_is_none_only_if_a_frame_that_takes_it_away_can_be_taught(cell, result, paper, axes):
    """The error that is stated, against the true robot's motion in the frames that can be taught."""
    robot, found = replace(result[0], work_frame=axes), result[1]
    belief = robot.belief(found)
    task = Task.of(cell.settings, robot, belief)
    actual = robot.mechanism.convention.free_parameters(paper.actual)
    stated = -error_jacobian(belief, task.poses, task.workspace) @ (found.free - actual)

    def there(poses):
        return np.array(
            [reached(paper.actual, found.geometry, poses.pose(row))[1] for row in range(len(poses))]
        )

    workspace = there(task.workspace)

    def left(frames):
        return turned_in(frames, axes, workspace, task.workspace).ravel()

    best = least_squares(left, np.zeros(6 + len(axes)), x_scale="jac").x
    true = turned_in(best, axes, there(task.poses), task.poses)[0]
    np.testing.assert_allclose(stated[:, :3], true, atol=0.002)
    assert np.linalg.norm(true, axis=-1).max() > 0.01


def test_what_cannot_be_taught_adds_to_u(cell, result):
    robot, found = result
    every = (replace(robot, work_frame=axes) for axes in ("", "z", "xyz"))
    verified = [verified_by(cell, (one, found), held_out()).accuracy for one in every]
    shifted, about_z, free = (accuracy.position.expanded or 0.0 for accuracy in verified if accuracy)
    assert shifted > about_z > free > 0.0


@pytest.mark.parametrize("limit_mm", [0.01, 0.3, 30.0])
def test_by_held_out_records_that_were_not_predicted_nothing_is_decided_and_no_u_stated(
    cell, result, bent, limit_mm
):
    limited = replace(cell, settings=changed(cell.settings, {"acceptance.position_mm": limit_mm}))
    verified = verified_by(limited, result, held_out(bent))
    assert (verified.verdict, verified.is_offered) == (Verdict.NOT_EVALUATED, True)
    failed = [test for test in verified.tests if not test.passed]
    assert [test.name for test in failed] == ["held-out records"]
    assert "times as far off as the stated noise explains" in failed[0].sentence
    assert verified.accuracy is not None
    for _, unit, error in verified.accuracy.errors:
        assert (error.expanded, error.verdict) == (None, Verdict.NOT_EVALUATED)
        assert "U not stated" in error.sentence(unit)
    assert Verification.model_validate_json(verified.model_dump_json()) == verified, "null in JSON"
    told = verification_text(verified), outcome_line(IdentificationResult.of(result[1]), 35, verified)
    assert [one.count("U not stated") for one in told] == [2, 1]
    assert RunSummary(accuracy=verified.accuracy).document["expanded_mm"] is None


@pytest.mark.parametrize("how", [{"before": NEAR, "after": FAR}, {"left_travel": True}])
def test_what_is_worse_or_left_its_plates_is_a_fail_that_nobody_is_offered(cell, result, how):
    verified = verified_by(cell, result, held_out(**how))
    assert (verified.verdict, verified.is_worse, verified.is_offered) == (Verdict.FAIL, True, False)


@pytest.mark.parametrize("is_calibrated", [False, True])
def test_where_deviations_only_scatter_the_records_say_whether_the_geometry_is_better(
    cell, visit, is_calibrated
):
    settings = changed(cell.settings, {"noise.stops": 0.3})
    robot = robot_of(replace(cell, settings=settings))
    found = identify(robot.problem(visit(seed=2).measured(NOISE_MM, 1)))
    written = as_written(settings, robot, found.geometry).geometry
    if is_calibrated:
        robot = robot.with_controller(written)
    verified = verify(settings, robot.with_controller(written), found, held_out(before=FAR, after=FAR))
    assert (verified.verdict, verified.is_worse) == (Verdict.NOT_EVALUATED, False)
    assert verified.is_kept != is_calibrated


@pytest.mark.parametrize("is_worse", [False, True])
def test_zeros_that_may_not_run_are_named_where_the_controller_reads_the_encoders(
    cell, result, bent, is_worse
):
    measured = held_out(bent, before=NEAR if is_worse else FAR, after=FAR if is_worse else NEAR)
    told = []
    for protocol, includes_zeros in [("controller", True), ("controller", False), ("canopen", True)]:
        changes = {"encoders.protocol": protocol, "controller.joints_include_zeros": includes_zeros}
        settings = changed(cell.settings, changes)
        verified = verified_by(replace(cell, settings=settings), result, measured)
        assert verified.is_worse == is_worse
        told.append(ZEROS_DOUBTED.rstrip(".") in reason_of(verified))
    assert told == [True, False, False]


def test_zeros_are_not_doubted_where_the_held_out_records_agree(cell, result):
    changes = {"encoders.protocol": "controller", "controller.joints_include_zeros": True}
    settings = changed(cell.settings, changes)
    worse = verified_by(replace(cell, settings=settings), result, held_out(before=NEAR, after=FAR))
    assert reason_of(worse) == "worse than before"


@pytest.mark.parametrize("missing", ["before", "after"])
def test_without_both_measurements_nothing_is_evaluated(cell, result, missing):
    verified = verified_by(cell, result, held_out(**{missing: []}))
    assert (verified.verdict, verified.is_offered) == (Verdict.NOT_EVALUATED, False)


def test_the_outcome_says_what_was_used_the_error_and_the_verdict(cell, result):
    _, found = result
    verified = verified_by(cell, result, held_out())
    line = outcome_line(IdentificationResult.of(found), 35, verified)
    assert line.startswith("35 parameters, 55 records at 5 points; mean deviation at held-out poses 3.60")
    assert line.endswith(" mm (limit 0.3): pass")
