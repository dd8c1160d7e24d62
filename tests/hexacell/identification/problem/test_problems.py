"""The problem of records: its noise, parts of it, and data that cannot identify."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.errors import ExitCode, IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import Noise, Prior, Tolerances
from hexacell.identification.problem.problem import Assumptions
from hexacell.measurements.records import MeasurementSet
from tests.geometries import hexaglide_geometry
from tests.hexacell.altered_records import altered

ENCODERS = (0.01, 0.02, 0.005, 0.01, 0.03, 0.01)
GAUGES = (0.004, 0.05, 0.01)


def test_each_instrument_keeps_its_own_noise_and_what_else_is_stated() -> None:
    noise = Noise(0.01, 0.01, alignment=0.005, gauge_scale=0.001).with_devices(ENCODERS, GAUGES)
    assert noise.encoders == pytest.approx(np.array(ENCODERS))
    assert noise.gauges_mm == pytest.approx(np.array(GAUGES))
    assert noise.encoder == pytest.approx(np.sqrt(np.mean(np.square(ENCODERS))))
    assert (noise.alignment, noise.gauge_scale) == (0.005, 0.001)


def test_the_covariance_of_a_record_is_that_of_drawn_records() -> None:
    random = np.random.default_rng(1)
    by_joints = random.standard_normal((3, 6))
    encoders = ENCODERS * random.standard_normal((200_000, 6))
    drawn = encoders @ by_joints.T + GAUGES * random.standard_normal((200_000, 3))
    noise = Noise(1.0, 1.0).with_devices(ENCODERS, GAUGES)
    covariance = noise.record_covariance(by_joints[None])[0]
    assert covariance == pytest.approx(np.cov(drawn.T), rel=0.02, abs=2e-5)


@pytest.fixture
def assumptions(hexaglide, paper):
    prior = Prior.of(hexaglide, paper.nominal, Tolerances({"S": 7.0, "B": 3.0, "l": 1.0}))
    controller = CommandingGeometry.of(hexaglide, paper.nominal)
    return Assumptions(hexaglide, controller, paper.branch, prior, Noise(0.01, 0.01))


@pytest.fixture
def records(paper, visit):
    return (
        visit(paper.actual, paper.nominal, points=3, orientations=4, seed=4).measured(0.01, seed=2).records
    )


def assert_same(one, other):
    for name in ("joints", "deviations", "labels", "first_rows", "has_start_pose", "initial_parameters"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("choice", "joints"):
        np.testing.assert_array_equal(getattr(one.commands, name), getattr(other.commands, name))
    for poses, others in ((one.start, other.start), (one.commands.poses, other.commands.poses)):
        np.testing.assert_allclose(poses.positions, others.positions, atol=1e-9)
        np.testing.assert_allclose(poses.rotations, others.rotations, atol=1e-12)


@pytest.mark.parametrize("known", [[0], [0, 1, 2, 3, 4], [0, 4, 5, 8, 11], [0, 1, 4, 6, 9, 10]])
def test_it_is_that_of_all_records_whichever_were_known(assumptions, records, known):
    some = assumptions.problem(MeasurementSet(tuple(records[row] for row in known)))
    every = MeasurementSet(records)
    assert_same(assumptions.problem(every, known=some), assumptions.problem(every))


def test_what_was_known_under_another_geometry_does_not_count(hexaglide, assumptions, records):
    known = assumptions.problem(MeasurementSet(records[:-1]))
    another = replace(assumptions, controller=CommandingGeometry.of(hexaglide, assumptions.prior.centre))
    every = MeasurementSet(records)
    assert_same(another.problem(every, known=known), another.problem(every))


def test_one_point_is_refused_however_many_records_it_has_and_no_records(visit, make_problem):
    exact = visit(points=1, orientations=40, seed=0)
    with pytest.raises(IdentifiabilityError, match=r"one point.* 35 parameters.*two points") as caught:
        identify(make_problem(exact.measured()))
    assert caught.value.exit_code is ExitCode.OUT_OF_LIMITS
    with pytest.raises(IdentifiabilityError, match="two points"):
        identify(make_problem(MeasurementSet(())))


@pytest.mark.parametrize(
    ("points", "orientations", "equations", "missing"), [(2, 6, 30, 2), (5, 3, 30, 2), (2, 2, 6, 10)]
)
def test_too_few_records_are_refused_with_the_number_missing(
    visit, make_problem, points, orientations, equations, missing
):
    exact = visit(points=points, orientations=orientations, seed=1)
    words = f"{points * orientations} records at {points} points give {equations} .* {missing} more records"
    with pytest.raises(IdentifiabilityError, match=words):
        identify(make_problem(exact.measured()))


def test_the_number_reported_as_missing_is_enough(visit, make_problem):
    """Two more than the 12 above."""
    exact = visit(points=2, orientations=7, seed=1)
    found = identify(make_problem(exact.measured(), noise=Noise(1e-4, 1e-4)))
    assert found.termination.converged
    assert found.dof == 1


def test_records_that_cannot_be_used_do_not_count(visit, make_problem, spoil):
    """15 records would do, but two of them are of no machine."""
    measured = visit(points=2, orientations=7, seed=1).measured()
    for label in ((1, 3), (2, 5)):
        measured = spoil(measured, label, joints=(-300, -300, -300, 300, 300, 300))
    with pytest.raises(IdentifiabilityError, match="12 records at 2 points"):
        identify(make_problem(measured))


def test_joints_or_a_drawing_of_another_machine_are_refused(visit, make_problem, paper) -> None:
    """For instance with the sign of the encoders reversed."""
    measured = visit(seed=2).measured()
    reversed_encoders = altered(measured, lambda r: {"joints": np.negative(r.joints)})
    with pytest.raises(IdentifiabilityError, match=r"\d+ of 55 records .* first is point 1, orientation 1"):
        make_problem(reversed_encoders)
    other = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], paper.nominal["l"] - 150.0)
    with pytest.raises(IdentifiabilityError, match="joint variables do not belong to the commanded pose"):
        make_problem(visit(seed=2).measured(), drawing=other, controller=other)


def test_meaningless_deviations_never_give_a_good_fit(visit, make_problem):
    measured = visit(seed=2).measured()
    random = np.random.default_rng(0)
    nonsense = altered(measured, lambda _: {"deviation": random.uniform(-5, 5, 3)})
    found = identify(make_problem(nonsense), find_outliers=False)
    assert not found.termination.converged or found.chi2 > 1000 * found.dof
