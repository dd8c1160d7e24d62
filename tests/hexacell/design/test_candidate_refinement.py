"""Candidates are turned to where a record gains more, and stay within the limits and the travel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.design.candidate_refinement import QUICK, THOROUGH, CandidateSpace, RatedRecords, Rounds
from hexacell.design.candidates import Amplitudes, orientations, rows_apart
from hexacell.design.criteria import D_OPTIMAL
from hexacell.design.predicted_records import SAFETY_SIGMAS, TRAVEL_SHARE, gauge_zero_at

TILT = float(np.radians(45.0))
FEW, MANY = 512, 16384
SEEDS = range(3, 6)


@pytest.fixture(scope="module", params=["little", "much"])
def space(request, know) -> CandidateSpace:
    """Of the first point, when little is known of the robot, and when much is."""
    found = request.getfixturevalue(request.param)
    belief = know(found)
    return CandidateSpace(
        belief,
        gauge_zero_at(belief, found, 1),
        lambda some: D_OPTIMAL.gain(belief.covariance, some.jacobian, some.covariance),
    )


def rated(space: CandidateSpace, count: int, seed: int = SEEDS[0]) -> RatedRecords:
    turns = orientations(count, TILT, seed, Amplitudes.MOSTLY_LARGE)
    found = space.rated(turns @ space.zero.orientation)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def candidates(space) -> RatedRecords:
    return rated(space, FEW)


@pytest.fixture(scope="module", params=[QUICK, THOROUGH], ids=["quick", "thorough"])
def rounds(request) -> Rounds:
    found: Rounds = request.param
    return found


@pytest.fixture(scope="module")
def refined(space, candidates, rounds) -> RatedRecords:
    found: RatedRecords = space.refined(candidates, rounds)
    return found


def test_few_refined_ones_gain_more_than_the_best_of_thirty_times_as_many(space) -> None:
    many, quick, thorough = (
        np.mean([found.gains.max() for found in each])
        for each in (
            [rated(space, MANY, seed) for seed in SEEDS],
            [space.refined(rated(space, FEW, seed), QUICK) for seed in SEEDS],
            [space.refined(rated(space, FEW, seed), THOROUGH) for seed in SEEDS],
        )
    )
    assert many < quick < thorough


def test_all_candidates_stay_and_all_are_possible(space, candidates, refined) -> None:
    assert set(candidates.gains.tolist()) <= set(refined.gains.tolist())
    again = space.rated(refined.records.targets.poses.rotations)
    assert again is not None
    np.testing.assert_allclose(again.gains, refined.gains, rtol=1e-9)
    used = np.abs(refined.records.deviation) + SAFETY_SIGMAS * refined.records.sigma
    assert used.max() <= TRAVEL_SHARE * space.belief.limits.gauge_travel_mm


@given(
    angles=st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=30),
    most=st.integers(1, 12),
    apart=st.floats(0.01, 1.0),
)
def test_orientations_apart(angles: list[float], most: int, apart: float) -> None:
    """About one axis, where the angle between two is plain."""
    turned = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()
    rows = rows_apart(turned, np.arange(len(angles)), most, apart).tolist()
    between = np.abs(np.subtract.outer(angles, angles))
    between = np.minimum(between, 2.0 * np.pi - between)
    assert rows[0] == 0
    assert rows == sorted(set(rows))
    assert len(rows) <= most
    assert all(between[a, b] > apart - 1e-6 for a in rows for b in rows if a != b)
    left_out = set(range(len(angles))) - set(rows)
    if len(rows) < most:
        assert all(min(between[row, kept] for kept in rows) <= apart + 1e-6 for row in left_out)
