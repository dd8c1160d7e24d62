"""Repeatability: the scatter over visits of the same pose."""

import numpy as np
import pytest

from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.noise.record_noise import Repeatability, repeatability

STILL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def visits(*rows):
    """Records of (point, orientation, a, deviation)."""
    return MeasurementSet(
        tuple(
            Record(point, orientation, Pose(0.0, 0.0, 500.0, a), STILL, deviation)
            for point, orientation, a, deviation in rows
        )
    )


def test_without_a_second_visit_at_the_same_point_there_is_no_repeatability():
    assert repeatability(visits((1, 1, 0.0, (0, 0, 0)), (1, 2, 5.0, (1, 2, 3)))) is None
    assert repeatability(visits((1, 1, 5.0, (0, 0, 0)), (2, 1, 5.0, (1, 2, 3)))) is None


def test_standard_deviations_are_pooled_over_poses():
    measured = visits(
        (1, 1, 0.0, (0.0, 0.0, 0.0)),
        (1, 2, 5.0, (1.0, 1.0, 1.0)),
        (1, 3, 0.0, (0.2, 0.0, -0.4)),
        (2, 1, 0.0, (0.0, 3.0, 0.0)),
        (2, 2, 0.0, (0.3, 3.0, 0.0)),
        (2, 3, 0.0, (0.3, 3.6, 0.0)),
    )
    found = repeatability(measured)
    x = [[0.0, 0.2], [0.0, 0.3, 0.3]]
    pooled = np.sqrt(sum(np.var(group) * len(group) for group in x) / 3)
    assert found is not None
    assert (found.poses, found.degrees_of_freedom) == (2, 3)
    assert found.per_axis_mm[0] == pytest.approx(pooled)
    assert found.per_axis_mm[1] == pytest.approx(np.sqrt(np.var([3.0, 3.0, 3.6]) * 3 / 3))
    assert found.per_axis_mm[2] == pytest.approx(np.sqrt(0.08 / 3))


@pytest.mark.parametrize(("apart", "same"), [(1e-8, True), (1e-5, False)])
def test_commands_agree_to_a_millionth(apart, same):
    measured = visits((1, 1, 7.25, (0, 0, 0)), (1, 2, 7.25 + apart, (0.1, 0, 0)))
    assert (repeatability(measured) is not None) == same


def test_rejected_records_do_not_count():
    rows = [(1, n, 0.0, (0.01 * n, 0.0, 0.0)) for n in range(1, 5)]
    measured = visits(*rows, (1, 5, 0.0, (25.4, 0.0, 0.0)))
    spoilt, clean = repeatability(measured), repeatability(measured, {(1, 5)})
    assert spoilt is not None
    assert clean is not None
    assert spoilt.per_axis_mm[0] > 10.0
    assert clean.per_axis_mm[0] == pytest.approx(np.std([0.01, 0.02, 0.03, 0.04], ddof=1))


def test_known_scatter_is_found_and_its_lower_limit_holds():
    """95 of 100 lower limits are below the truth: within three standard errors of that."""
    random = np.random.default_rng(1)
    held = []
    for _ in range(300):
        rows = [
            (1, 10 * pose + n + 1, float(pose), tuple((0.1 * random.standard_normal(3)).tolist()))
            for pose in range(3)
            for n in range(3)
        ]
        found = repeatability(visits(*rows))
        assert found is not None
        held.append(found.at_least_mm < 0.1 * np.sqrt(3.0))
    assert np.mean(held) == pytest.approx(0.95, abs=3.0 * np.sqrt(0.95 * 0.05 / 300))


def test_few_visits_do_not_prove_that_scatter_dominates():
    few = Repeatability((0.1, 0.1, 0.1), degrees_of_freedom=1, poses=1)
    many = Repeatability((0.1, 0.1, 0.1), degrees_of_freedom=60, poses=20)
    error_mm = 0.14
    assert few.distance_mm > error_mm
    assert not few.dominates(error_mm)
    assert many.dominates(error_mm)
