"""Probabilities and quantiles, against closed forms of other kinds."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell import distributions

PROBABILITIES = st.floats(1e-6, 1.0 - 1e-6)


@given(PROBABILITIES)
def test_one_square_is_normal_and_two_are_exponential_and_limits_are_exceeded_as_often(exceeded) -> None:
    limit = distributions.chi_square_limit(2, exceeded)
    assert limit == pytest.approx(-2.0 * math.log(exceeded), rel=1e-9)
    assert distributions.chi_square_exceedance(2, limit) == pytest.approx(exceeded, rel=1e-9)
    limit = distributions.normal_limit(0.5 * exceeded)
    assert distributions.chi_square_limit(1, exceeded) == pytest.approx(limit**2, rel=1e-6, abs=1e-12)
    below = distributions.normal_probability(np.array([-distributions.normal_limit(exceeded)]))
    assert below == pytest.approx([exceeded], rel=1e-9)


@given(st.lists(st.floats(-8.0, 8.0), min_size=1))
def test_the_normal_probability_is_the_error_function(values: list[float]) -> None:
    expected = [0.5 * math.erfc(-value / math.sqrt(2.0)) for value in values]
    assert distributions.normal_probability(np.array(values)) == pytest.approx(expected, rel=1e-9)


@given(st.floats(-1e3, 1e3))
def test_student_with_one_degree_of_freedom_is_cauchy(value: float) -> None:
    exceeded = 0.5 - math.atan(value) / math.pi
    assert distributions.student_exceedance(1, value) == pytest.approx(exceeded, rel=1e-6)
    assert distributions.student_limit(1, exceeded) == pytest.approx(value, rel=1e-6, abs=1e-6)
