"""The paper's simulation: both estimators on the same records, whoever computes it and however often."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.study.paper_simulation import Angles, Trial, run_trial

MOST = Trial(5, 11, 0)


@pytest.fixture(scope="module")
def most():
    return run_trial(MOST)


def test_without_noise_both_find_the_robot(most) -> None:
    assert most.exact.is_settled
    assert max(most.exact.paper_mm, most.exact.ours_mm) < 1e-6


def test_with_noise_errors_are_those_of_the_order_of_the_paper(most) -> None:
    assert 0.05 < most.noisy.ours_mm < most.noisy.paper_mm < 5.0
    assert most.noisy.steps[-1] == pytest.approx(most.noisy.paper_mm)


def test_the_same_trial_is_the_same_again(most) -> None:
    assert run_trial(MOST) == most


def test_fewer_points_are_the_first_of_more(most) -> None:
    """So that a figure shows what further points add."""
    fewer = run_trial(Trial(2, 11, 0))
    assert fewer.deviation_mm <= most.deviation_mm


@pytest.mark.parametrize(("points", "orientations"), [(1, 11), (2, 5)])
def test_what_cannot_be_identified_is_refused(points: int, orientations: int) -> None:
    found = run_trial(Trial(points, orientations, 0))
    assert found.exact.ours == found.noisy.ours == {}
    assert found.exact.paper_mm > 1.0


@pytest.mark.parametrize("angles", Angles)
def test_angles_are_rotations(angles: Angles) -> None:
    three = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3))
    expected = {
        Angles.FIXED_AXES: Rotation.from_euler("xyz", three),
        Angles.ZYZ: Rotation.from_euler("ZYZ", three),
        Angles.VECTOR: Rotation.from_rotvec(three),
    }[angles]
    np.testing.assert_allclose(angles.turns(three), expected.as_matrix(), atol=1e-12)
