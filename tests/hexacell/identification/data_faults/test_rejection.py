"""A bad record is found, named and left out; good ones stay, however bad the bad ones are."""

from __future__ import annotations

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.measurements.records import MeasurementSet


def without(measurements, *labels):
    kept = [record for record in measurements.records if (record.point, record.orientation) not in labels]
    return MeasurementSet(tuple(kept))


def named(found):
    return {record for record, _ in found.left_out}


@pytest.mark.parametrize(
    ("label", "error"),
    [
        ((3, 7), {"deviation": (0.0, 0.0, 0.5)}),
        ((5, 11), {"deviation": (-0.3, 0.2, 0.0)}),
        ((1, 1), {"deviation": (0.0, 0.5, 0.0)}),  # the reference is a record like the others
        ((4, 2), {"joints": (0, 0, 0, 0.3, 0, 0)}),
        ((2, 9), {"joints": (20.0, 0, 0, 0, 0, -10.0)}),
    ],
)
def test_a_bad_record_is_named_and_the_rest_says_what_it_would_have_said(
    noisy, spoil, make_problem, label, error
):
    found = identify(make_problem(spoil(noisy, label, **error)))
    assert named(found) == {label}
    assert found.data_faults[0].statistic > 100.0
    clean = identify(make_problem(without(noisy, label)))
    assert found.geometry.largest_difference(clean.geometry) < 1e-6
    assert found.records == clean.records == 54
    assert found.chi2 == pytest.approx(clean.chi2, rel=1e-6)
    assert found.dof == clean.dof


def test_a_record_written_down_at_the_wrong_pose_is_named(noisy, make_problem):
    """The encoders of one orientation beside the deviation of another."""
    records = list(noisy.records)
    wrong = records[16]
    records[16] = type(wrong)(
        wrong.point, wrong.orientation, wrong.pose, records[17].joints, wrong.deviation
    )
    found = identify(make_problem(MeasurementSet(tuple(records))))
    assert named(found) == {(wrong.point, wrong.orientation)}


def test_sliders_where_no_machine_can_be_are_named_too(noisy, spoil, make_problem):
    """Forward kinematics finds no pose there at all, so that there is not even a residual."""
    apart = spoil(noisy, (2, 4), joints=(-300, -300, -300, 300, 300, 300))
    found = identify(make_problem(apart))
    assert named(found) == {(2, 4)}
    assert found.data_faults[0].statistic == np.inf
    assert found.records == 54
    clean = identify(make_problem(without(noisy, (2, 4))))
    assert found.geometry.largest_difference(clean.geometry) < 1e-6


def test_several_bad_records_are_all_named(noisy, spoil, make_problem):
    bad = {(1, 4): 0.4, (2, 2): -0.5, (3, 8): 1.0, (5, 5): 0.2}
    measured = noisy
    for label, error in bad.items():
        measured = spoil(measured, label, deviation=(0.0, error, 0.0))
    found = identify(make_problem(measured))
    assert named(found) == set(bad)
    assert found.records == 55 - len(bad)


def test_a_scatter_of_twice_the_noise_is_no_outlier(noisy, spoil, make_problem):
    found = identify(make_problem(spoil(noisy, (3, 7), deviation=(0.02, 0.0, 0.0))))
    assert found.data_faults == ()


def test_no_more_than_a_tenth_is_ever_left_out(noisy, spoil, make_problem):
    """Where so many disagree nobody can say which are right: chi-square says it instead."""
    measured = noisy
    random = np.random.default_rng(0)
    for point in range(1, 6):
        for orientation in range(2, 6):
            error = random.uniform(-0.15, 0.15, 3)
            measured = spoil(measured, (point, orientation), deviation=error)
    found = identify(make_problem(measured))
    assert len(found.left_out) <= 6
    assert found.records >= 49
    assert found.chi2 > 3 * found.dof


def test_nothing_is_left_out_where_nobody_asked(noisy, spoil, make_problem):
    spoilt = make_problem(spoil(noisy, (3, 7), deviation=(0.0, 0.0, 0.5)))
    found = identify(spoilt, find_outliers=False)
    assert found.data_faults == ()
    assert found.records == 55
    assert found.chi2 > 500
