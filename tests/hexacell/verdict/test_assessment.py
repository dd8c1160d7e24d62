"""The assessment of an identification says first what matters, and names what the data lack."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.cell.measuring import TaskSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import DataFault, DataFaultKind, Termination
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS, Hexaglide
from hexacell.kinematics.pose import FrameTransform, Pose, PoseBatch
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import make_robot
from hexacell.text.identification import identification_report
from hexacell.verdict.assessment import assess
from hexacell.verdict.findings import findings, pair_sentences
from hexacell.verdict.fit_document import fit_document
from tests.hexacell.altered_records import altered

AGAIN = 100
"""Added to the orientation's number at a second visit."""

TURNED = np.eye(3) + 0.004 * np.array([[0.0, 1.0, -0.5], [0.3, 0.0, 0.2], [0.4, -0.8, 0.0]])
"""Readings of gauges that are not square to each other."""


@pytest.fixture(scope="module")
def settings(bundled_cell):
    return bundled_cell.settings


@pytest.fixture(scope="module")
def robot(settings, paper):
    return make_robot(settings, ControllerGeometry(paper.nominal, paper.branch))


@pytest.fixture(scope="module")
def assessed_of(settings, robot):
    def assessed(measurements, robot=robot, settings=settings):
        found = identify(robot.problem(measurements), find_outliers=False)
        return assess(settings, robot, measurements, found)

    return assessed


@pytest.fixture(scope="module")
def good(visit, assessed_of):
    return assessed_of(visit(seed=2).measured(0.01, seed=1))


def visited_twice(measurements, scatter_mm, seed=0):
    """Every pose once more, the ball elsewhere by some scatter that the encoders do not see."""
    random = np.random.default_rng(seed)

    def again(record):
        deviation = record.deviation + scatter_mm * random.standard_normal(3)
        return {"orientation": record.orientation + AGAIN, "deviation": deviation}

    return MeasurementSet((*measurements.records, *altered(measurements, again).records))


def test_a_good_result_has_the_verdict_first_and_then_the_accuracy(good):
    verdict, accuracy, *more = findings(good)
    assert verdict.startswith("Good: the records agree")
    assert "At 6 task poses the position error is now 19.025 mm (rms)" in accuracy
    assert f"{good.accuracy.after.position_rms_mm:.2g} mm with the identified geometry" in accuracy
    assert more == []


def test_far_too_much_noise_makes_it_doubtful_and_names_the_levels(visit, assessed_of):
    assessed = assessed_of(visit(seed=2).measured(0.03, seed=1))
    verdict, *more = findings(assessed)
    assert verdict.startswith("Doubtful: the residuals are ")
    assert "times the stated noise" in verdict
    assert any("encoders 0.0" in sentence and "gauges 0.0" in sentence for sentence in more)
    stated = fit_document(assessed)["uncertainty"]
    assert (stated["expanded_mm"], stated["expanded_deg"]) == (None, None), "the model is contradicted"
    report = " ".join(identification_report(assessed).split())
    assert "U at the task poses is not stated" in report
    assert "U, 95 %" not in report


def test_residuals_that_are_too_large_are_followed_by_what_may_be(visit, assessed_of, good):
    measured = visit(seed=2).measured(0.01, seed=1)
    assessed = assessed_of(altered(measured, lambda r: {"deviation": np.array(r.deviation) @ TURNED}))
    verdict, causes, *_ = findings(assessed)
    assert verdict.startswith("Doubtful: ")
    assert causes.startswith("The model does not fit, and no cause is proven. What may be")
    assert ": the gauges (scale, alignment, drift of the zero) or an oval ball " in causes
    assert assessed.possible_causes[0].share > 0.9
    listed = fit_document(assessed)["possible_causes"]
    assert [set(cause) for cause in listed] == [{"name", "share"}] * len(assessed.possible_causes)
    assert listed[0]["share"] == assessed.possible_causes[0].share
    assert good.possible_causes == ()


def test_data_that_determine_few_parameters_give_no_result(visit, assessed_of):
    assessed = assessed_of(visit(points=2, orientations=9, degrees=3.0).measured(0.01))
    verdict = findings(assessed)[0]
    assert verdict.startswith("Incomplete: these records leave ")
    assert "Measure at more points" in verdict
    assert assessed.found.termination.converged
    assert not assessed.refused
    assert not assessed.is_usable


def test_a_few_undetermined_parameters_are_named(good, monkeypatch):
    monkeypatch.setattr(type(good.found), "undetermined", ("B2z", "B3z", "B5z", "l3"))
    verdict, *_, last = findings(good)
    assert verdict.startswith("Good")
    assert "hardly determine 2 (B2/B3/B5 z, leg 3 length): they stay near the drawing" in last
    assert good.is_usable


def test_a_solver_that_did_not_converge_gives_no_result(good):
    solution = replace(good.found.solution, termination=Termination.STUCK)
    stuck = replace(good, found=replace(good.found, solution=solution))
    assert [gate["name"] for gate in fit_document(stuck)["gates"] if not gate["passed"]] == ["converged"]
    impossible = replace(good, impossible=("a negative weight",))
    assert findings(impossible)[0] == "Refused: No machine has a negative weight."
    assert not impossible.is_usable
    assert findings(stuck)[0] == f"No result: the solver ended because {Termination.STUCK.value}."
    assert not stuck.is_usable


def test_where_repeatability_dominates_recalibrating_will_not_help(visit, assessed_of, robot, paper):
    """A controller whose geometry is right to hundredths, on a machine with play of 0.3 mm."""
    nearly = Geometry(
        HEXAGLIDE_PARAMETERS, paper.actual.vector + 0.01 * np.random.default_rng(3).standard_normal(42)
    )
    nearly = robot.mechanism.normalize_frames(nearly)[0]
    known = replace(
        robot, drawing=nearly, controller=nearly, frames=robot.mechanism.normalize_frames(nearly)[1]
    )
    measured = visited_twice(visit(commanding=nearly, seed=2).measured(0.01), scatter_mm=0.3)
    assessed = assessed_of(measured, known)
    assert assessed.repeatability.degrees_of_freedom == 55
    assert assessed.repeatability.distance_mm == pytest.approx(0.3 * np.sqrt(3 / 2), rel=0.2)
    assert assessed.accuracy.removable_mm < 0.3
    assert findings(assessed)[0].startswith("Recalibrating will not help: the machine repeats")
    assert fit_document(assessed)["repeatability"]["recalibrating_helps"] is False


def gross_error(point, orientation):
    return DataFault(
        DataFaultKind.GROSS_ERROR,
        f"gauge y is 0.2 mm off at point {point}, orientation {orientation}",
        "Measure it again",
        gauges="y",
        left_out=((point, orientation),),
    )


def test_records_left_out_are_named_and_not_counted_in_the_repeatability(good, settings, robot, visit):
    twice = visited_twice(visit(seed=2).measured(0.01, seed=1), scatter_mm=0.0)
    wrong = replace(twice.records[-1], deviation=(25.4, 0.0, 0.0))
    measured = MeasurementSet((*twice.records[:-1], wrong))
    left = replace(good.found, data_faults=(gross_error(wrong.point, wrong.orientation),))
    assessed = assess(settings, robot, measured, left)
    assert assessed.repeatability is not None
    assert assessed.repeatability.distance_mm < 1e-9
    assert any(f"point {wrong.point}, orientation {wrong.orientation}" in s for s in findings(assessed))


def test_task_poses_out_of_reach_are_numbered_as_in_the_cell_file(visit, assessed_of, settings):
    poses = ((0.0, 0.0, 550.0, 0.0, 0.0, 0.0), (0.0, 900.0, 550.0, 0.0, 0.0, 0.0))
    task = settings.model_copy(update={"task": TaskSettings(poses=poses)})
    assessed = assessed_of(visit(seed=2).measured(0.01, seed=1), settings=task)
    assert "Task poses that the robot cannot reach are left out: 2." in findings(assessed)
    document = fit_document(assessed)["accuracy"]
    assert document["reachable"] == [True, False]
    assert document["poses"][1]["y"] == pytest.approx(900.0)
    assert len(document["after"]["position_mm"]) == 1


def test_without_task_poses_the_accuracy_is_that_across_the_workspace(visit, assessed_of, settings):
    bare = settings.model_copy(update={"task": TaskSettings()})
    assessed = assessed_of(visit(seed=2).measured(0.01, seed=1), settings=bare)
    assert not assessed.task_named
    assert len(assessed.accuracy.poses) > 20
    assert "poses across the workspace" in findings(assessed)[1]


def seen_from(change, settings):
    """A cell's task and points in other frames."""
    task = change.poses(PoseBatch.of(Pose(*pose) for pose in settings.task.poses))
    points = change.poses(PoseBatch.of(Pose(*point) for point in settings.identification.points))
    places = tuple(tuple(point) for point in points.positions.tolist())
    return settings.model_copy(
        update={
            "task": TaskSettings(poses=tuple(task.pose(row).as_tuple() for row in range(len(task)))),
            "identification": settings.identification.model_copy(update={"points": places}),
        }
    )


def test_the_frames_of_the_controller_s_config_do_not_matter(visit, assessed_of, settings, paper):
    """The same machine and records, all told in frames that are rolled, shifted and turned.

    But for the limit of the tilt, which is from where the controller has the platform level; here no pose
    is tilted as far.
    """
    limits = settings.limits.model_copy(update={"tilt_deg": 80.0})
    settings = settings.model_copy(update={"limits": limits})
    change = FrameTransform(
        base=Rotation.from_rotvec([0.3, 0.0, 0.0]).as_matrix(),
        origin=np.array([40.0, -25.0, 10.0]),
        platform=Rotation.from_rotvec([0.1, -0.2, 0.1]).as_matrix(),
    )
    measured = visit(seed=2).measured(0.01, seed=1)
    commands = change.poses(measured.poses)
    told = MeasurementSet(
        tuple(
            replace(
                record, pose=commands.pose(row), deviation=tuple((change.base @ record.deviation).tolist())
            )
            for row, record in enumerate(measured.records)
        )
    )
    elsewhere = seen_from(change, settings)
    controller = ControllerGeometry(Hexaglide().change_frames(paper.nominal, change), paper.branch)
    assessed = assessed_of(told, make_robot(elsewhere, controller), elsewhere)
    here = ControllerGeometry(paper.nominal, paper.branch)
    before = assessed_of(measured, make_robot(settings, here), settings)
    for name in ("before", "after"):
        mine, other = getattr(assessed.accuracy, name), getattr(before.accuracy, name)
        np.testing.assert_allclose(mine.distances_mm, other.distances_mm, rtol=1e-4)
        np.testing.assert_allclose(mine.angles, other.angles, rtol=1e-4)
    for pose, (x, y, z, *_) in zip(assessed.task, elsewhere.task.poses, strict=True):
        np.testing.assert_allclose(pose.position, [x, y, z])
    parts = [
        (mine, other)
        for (_, mine), (_, other) in zip(assessed.correlated, before.correlated, strict=True)
        if other
    ]
    assert parts
    for mine, other in parts:
        assert mine is not None
        assert other is not None
        expected = change.poses(PoseBatch.of([other.command])).pose(0)
        np.testing.assert_allclose(mine.command.as_tuple(), expected.as_tuple(), atol=1e-3)


def test_pairs_are_named_with_the_measurement_that_separates_them(good):
    assert good.correlated[0][0].first == "l2"
    sentences = pair_sentences(good)
    assert sentences
    assert all("cannot be separated from these poses" in sentence for sentence in sentences)
    assert sentences[0].startswith("leg 2 length and leg 3 length cannot be separated")
    named = [part for _, part in good.correlated if part]
    for part in named:
        way = "turn" if part.axis == "z" else "tilt"
        words = f"{way} {part.degrees:+.0f} deg about {part.axis} at point {part.point}"
        assert any(words in sentence for sentence in sentences)


def test_the_document_is_json_and_has_the_findings(good):
    document = json.loads(json.dumps(fit_document(good), allow_nan=False))
    assert document["findings"] == list(findings(good))
    assert document["verdict"] == "not evaluated"
    assert document["goodness"]["agreement"] == "agrees"
    assert document["goodness"]["expected_chi2"] == pytest.approx(document["dof"], abs=0.1)
    assert document["noise"]["encoder_mm"]["stated"] == 0.01
    assert document["noise"]["told_apart"] is True
    assert document["repeatability"] is None
    pair = document["correlated"][0]
    assert pair["parameters"] == ["l2", "l3"]
    assert set(pair) == {"parameters", "correlation", "measure"}
    measures = [one["measure"] for one in document["correlated"] if one["measure"]]
    assert measures
    assert set(measures[0]) == {"point", "axis", "angle_deg", "pose", "correlation"}
    assert set(measures[0]["pose"]) == set("xyzabc")
    assert len(document["accuracy"]["before"]["position_mm"]) == 6
