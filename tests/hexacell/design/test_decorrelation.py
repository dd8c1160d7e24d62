"""The record that separates two correlated parameters, compared with its effect once it is measured."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.design.decorrelation import decorrelating_poses
from hexacell.identification.estimator import identify
from hexacell.measurements.records import MeasurementSet, Record
from tests.hexacell.conftest import reached

SEED = 2
DEGREES = 30.0


@pytest.fixture(scope="module")
def measured(visit):
    """Without noise, so that one more record does not change the estimate."""
    return visit(seed=SEED, degrees=DEGREES).measured()


@pytest.fixture(scope="module")
def found(measured, make_problem):
    return identify(make_problem(measured))


@pytest.fixture(scope="module")
def belief(know, found):
    return know(found)


def correlation_of(found, pair):
    everything = found.strongly_correlated(above=-1.0)
    return next(
        other.correlation
        for other in everything
        if (other.first, other.second) == (pair.first, pair.second)
    )


def test_the_record_changes_the_correlation_as_predicted(
    found, belief, measured, visit, paper, make_problem
):
    pairs = found.strongly_correlated()[:6]
    tried = [
        (pair, part)
        for pair, part in zip(pairs, decorrelating_poses(belief, found, pairs), strict=True)
        if part
    ]
    assert len(tried) >= 2
    exact = visit(seed=SEED, degrees=DEGREES)
    for pair, part in tried:
        joints, pose = reached(paper.actual, paper.nominal, part.command)
        reference = exact.balls[exact.labels.index((part.point, 1))]
        record = Record(part.point, 99, part.command, tuple(joints), tuple(pose[:3] - reference))
        more = identify(make_problem(MeasurementSet((*measured.records, record))))
        assert more.records == 56
        assert correlation_of(more, pair) == pytest.approx(part.correlation, abs=2e-5)
        assert 1.0 - abs(correlation_of(more, pair)) > 1.05 * (1.0 - abs(pair.correlation))


def test_the_ball_stays_within_the_travel(found, belief, visit, paper):
    exact = visit(seed=SEED, degrees=DEGREES)
    pairs = found.strongly_correlated()[:6]
    for part in filter(None, decorrelating_poses(belief, found, pairs)):
        _, pose = reached(paper.actual, paper.nominal, part.command)
        reference = exact.balls[exact.labels.index((part.point, 1))]
        assert np.abs(pose[:3] - reference).max() < 1.0


def test_limits_are_kept(found, belief):
    narrow = replace(belief, limits=replace(belief.limits, tilt=np.radians(15.0)))
    pairs = found.strongly_correlated()[:6]
    parts = [part for part in decorrelating_poses(narrow, found, pairs) if part]
    assert all(abs(part.degrees) < 15.0 for part in parts if part.axis != "z")


@pytest.mark.parametrize(
    ("pairs", "change"),
    [
        (3, {"gauge_travel_mm": 1e-6}),  # with almost no travel
        (1, {"joint_min": 0.0, "joint_max": 1.0}),  # where no pose is in reach
        (0, {}),
    ],
)
def test_there_may_be_no_record(found, belief, pairs, change):
    tight = replace(belief, limits=replace(belief.limits, **change))
    assert decorrelating_poses(tight, found, found.strongly_correlated()[:pairs]) == (None,) * pairs
