"""The problem of records, from that of some of them."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.problem.commanded_poses import CommandingGeometry
from hexacell.identification.problem.prior import Noise, Prior, Tolerances
from hexacell.identification.problem.problem import Assumptions
from hexacell.measurements.records import MeasurementSet


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
