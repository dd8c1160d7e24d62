"""The legs and their distances, against closed forms and brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize

from hexacell.kinematics.legs import segment_distances

points = arrays(float, (4, 3), elements=st.floats(-100, 100, width=32))


def nearest(ends):
    """By a bounded search from all corners."""
    start, end, other_start, other_end = ends

    def square(shares):
        one = start + shares[0] * (end - start)
        other = other_start + shares[1] * (other_end - other_start)
        return float(np.sum((one - other) ** 2))

    found = [
        minimize(square, corner, bounds=[(0, 1), (0, 1)]).fun
        for corner in ((0, 0), (0, 1), (1, 0), (1, 1), (0.5, 0.5))
    ]
    return np.sqrt(min(found))


@given(points)
def test_the_distance_of_two_segments_is_that_of_their_nearest_points(ends):
    if min(np.linalg.norm(ends[1] - ends[0]), np.linalg.norm(ends[3] - ends[2])) < 1.0:
        return
    assert segment_distances(*ends) == pytest.approx(nearest(ends), abs=1e-2)


@pytest.mark.parametrize(
    ("ends", "distance"),
    [
        ([[0, 0, 0], [10, 0, 0], [0, 3, 0], [10, 3, 0]], 3.0),
        ([[0, 0, 0], [10, 0, 0], [20, 3, 0], [30, 3, 0]], np.hypot(10, 3)),
        ([[0, 0, 0], [10, 0, 0], [5, -5, 2], [5, 5, 2]], 2.0),
        ([[0, 0, 0], [10, 0, 0], [5, 4, 0], [5, 9, 0]], 4.0),
        ([[0, 0, 0], [10, 0, 0], [5, -1, 0], [5, 1, 0]], 0.0),
    ],
    ids=["parallel", "parallel, one behind the other", "crossing above", "an end", "through each other"],
)
def test_the_distance_of_segments_that_are_easily_seen(ends, distance):
    assert segment_distances(*np.array(ends, dtype=float)) == pytest.approx(distance)
