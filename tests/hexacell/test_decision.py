"""The decision rule passes only what is surely within the limit; probabilities are closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell import distributions
from hexacell.cell.measuring import AcceptanceSettings
from hexacell.uncertainty.statement import LargestError
from hexacell.verdict.decision import Verdict, decide, decide_both, worst_verdict


@pytest.mark.parametrize(
    ("value", "expanded", "verdict"),
    [
        (0.09, 0.06, Verdict.PASS),
        (0.10, 0.06, Verdict.CONDITIONAL_PASS),
        (0.15, 0.06, Verdict.CONDITIONAL_PASS),
        (0.16, 0.06, Verdict.CONDITIONAL_FAIL),
        (0.22, 0.06, Verdict.FAIL),
        (0.00, 0.16, Verdict.NOT_EVALUATED),
        (0.30, 0.16, Verdict.NOT_EVALUATED),
        (6.00, 0.16, Verdict.FAIL),
        (math.nan, 0.01, Verdict.NOT_EVALUATED),
        (0.05, math.nan, Verdict.NOT_EVALUATED),
    ],
)
def test_a_limit_with_a_guard_band(value: float, expanded: float, verdict: Verdict) -> None:
    assert decide(LargestError(value, expanded), 0.15) is verdict


@pytest.mark.parametrize(
    ("value", "verdict"),
    [
        (0.06, Verdict.PASS),
        (0.07, Verdict.CONDITIONAL_PASS),
        (0.16, Verdict.CONDITIONAL_FAIL),
        (0.23, Verdict.CONDITIONAL_FAIL),
        (0.25, Verdict.FAIL),
    ],
)
def test_a_guard_band_wider_than_u(value: float, verdict: Verdict) -> None:
    position, orientation = LargestError(value, 0.06), LargestError(0.0, 0.1)
    assert decide(position, 0.15, guard_band_factor=1.5) is verdict
    limits = AcceptanceSettings(position_mm=0.15, orientation_deg=1.0, guard_band_factor=1.5)
    assert decide_both(position, orientation, limits) is verdict


def test_a_limit_within_a_wide_guard_band_is_not_passed() -> None:
    assert decide(LargestError(0.0, 0.11), 0.15) is Verdict.PASS
    assert decide(LargestError(0.0, 0.11), 0.15, guard_band_factor=1.5) is Verdict.NOT_EVALUATED


positive = st.floats(0.0, 10.0)


@given(positive, positive, st.floats(0.01, 10.0))
def test_only_a_value_that_is_surely_within_the_limit_passes(value, expanded, limit) -> None:
    verdict = decide(LargestError(value, expanded), limit)
    assert (verdict is Verdict.PASS) == (value + expanded <= limit)
    assert (verdict is Verdict.FAIL) == (value - expanded > limit)


@given(positive, positive, st.floats(0.01, 10.0), st.floats(0.0, 1.0))
def test_a_wider_limit_gives_no_worse_verdict(value, expanded, limit, wider) -> None:
    order = list(Verdict)
    tight, wide = (decide(LargestError(value, expanded), one) for one in (limit, limit + wider))
    assert order.index(wide) <= order.index(tight) or Verdict.NOT_EVALUATED in {tight, wide}


def test_several_are_as_bad_as_the_worst() -> None:
    assert worst_verdict([Verdict.PASS, Verdict.PASS]) is Verdict.PASS
    assert worst_verdict([Verdict.PASS, Verdict.NOT_EVALUATED]) is Verdict.NOT_EVALUATED
    assert worst_verdict([Verdict.FAIL, Verdict.NOT_EVALUATED]) is Verdict.FAIL
    assert worst_verdict([]) is Verdict.NOT_EVALUATED


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
