"""Data that cannot identify are refused, with what is missing."""

import numpy as np
import pytest

from hexacell.errors import ExitCode, IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.measurements.records import MeasurementSet
from tests.geometries import hexaglide_geometry
from tests.hexacell.altered_records import altered


def test_one_point_is_refused_however_many_records_it_has(visit, make_problem):
    exact = visit(points=1, orientations=40, seed=0)
    with pytest.raises(
        IdentifiabilityError, match=r"one point.* 35 parameters.*two points at least"
    ) as caught:
        identify(make_problem(exact.measured()))
    assert caught.value.exit_code is ExitCode.OUT_OF_LIMITS


def test_no_records_are_refused(make_problem):
    with pytest.raises(IdentifiabilityError, match="two points"):
        identify(make_problem(MeasurementSet(())))


@pytest.mark.parametrize(
    ("points", "orientations", "equations", "missing"), [(2, 6, 30, 2), (5, 3, 30, 2), (2, 2, 6, 10)]
)
def test_too_few_records_are_refused_with_the_number_missing(
    visit, make_problem, points, orientations, equations, missing
):
    exact = visit(points=points, orientations=orientations, seed=1)
    with pytest.raises(
        IdentifiabilityError,
        match=f"{points * orientations} records at {points} points give {equations} equations for 35 "
        f"parameters.* {missing} more records",
    ):
        identify(make_problem(exact.measured()))


def test_the_number_reported_as_missing_is_enough(visit, make_problem):
    """Two more than the 12 above."""
    exact = visit(points=2, orientations=7, seed=1)
    found = identify(make_problem(exact.measured(), noise=Noise(1e-4, 1e-4)))
    assert found.converged
    assert found.dof == 1


def test_records_that_cannot_be_used_do_not_count(visit, make_problem, spoil):
    """15 records would do, but two of them are of no machine."""
    measured = visit(points=2, orientations=7, seed=1).measured()
    for label in ((1, 3), (2, 5)):
        measured = spoil(measured, label, joints=(-300, -300, -300, 300, 300, 300))
    with pytest.raises(IdentifiabilityError, match="12 records at 2 points"):
        identify(make_problem(measured))


def test_joints_of_other_poses_are_refused_and_the_first_record_named(visit, make_problem):
    """For instance with the sign of the encoders reversed."""
    measured = visit(seed=2).measured()
    reversed_encoders = altered(measured, lambda r: {"joints": np.negative(r.joints)})
    with pytest.raises(
        IdentifiabilityError, match=r"\d+ of 55 records .* the first is point 1, orientation 1"
    ):
        make_problem(reversed_encoders)


def test_a_drawing_of_another_machine_is_refused(paper, visit, make_problem):
    other = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], paper.nominal["l"] - 150.0)
    with pytest.raises(IdentifiabilityError, match="joint variables do not belong to the commanded pose"):
        make_problem(visit(seed=2).measured(), drawing=other, controller=other)


def test_meaningless_deviations_never_give_a_good_fit(visit, make_problem):
    measured = visit(seed=2).measured()
    random = np.random.default_rng(0)
    nonsense = altered(measured, lambda _: {"deviation": random.uniform(-5, 5, 3)})
    found = identify(make_problem(nonsense), find_outliers=False)
    assert not found.converged or found.chi2 > 1000 * found.dof
