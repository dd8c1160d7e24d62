"""The verdict on held-out poses: better, within limits, and never without data."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.acceptance.validation import (
    DeviationStatistics,
    Verdict,
    calibration_outcome,
    check_outcome,
    validate,
)

LIMITS = {"mean_mm": 0.05, "largest_mm": 0.15}
BEFORE = DeviationStatistics(3.41, 6.0, 10)
positive = st.floats(0.0, 100.0)
spreads = st.builds(DeviationStatistics, positive, positive, st.integers(1, 50))


def test_statistics_are_of_distances_not_of_coordinates():
    spread = DeviationStatistics.of([[3.0, 4.0, 0.0], [0.0, 0.0, -1.0]])
    assert spread == DeviationStatistics(mean_mm=3.0, largest_mm=5.0, poses=2)


@given(st.lists(st.tuples(*[st.floats(-10, 10)] * 3), min_size=1, max_size=20))
def test_the_mean_never_exceeds_the_largest(deviations):
    spread = DeviationStatistics.of(deviations)
    assert spread is not None
    assert spread.mean_mm <= spread.largest_mm * (1 + 1e-12)
    assert spread.poses == len(deviations)


@pytest.mark.parametrize("nothing", [[], np.empty((0, 3))])
def test_no_deviations_give_no_statistics(nothing):
    assert DeviationStatistics.of(nothing) is None


@pytest.mark.parametrize(
    ("before", "after", "verdict"),
    [
        (BEFORE, DeviationStatistics(0.012, 0.03, 10), Verdict.PASS),
        (BEFORE, DeviationStatistics(0.05, 0.15, 10), Verdict.PASS),  # a limit may be reached
        (BEFORE, DeviationStatistics(0.0501, 0.06, 10), Verdict.OUT_OF_LIMITS),
        (BEFORE, DeviationStatistics(0.03, 0.1501, 10), Verdict.OUT_OF_LIMITS),
        (BEFORE, DeviationStatistics(3.42, 6.0, 10), Verdict.WORSE),
        (
            DeviationStatistics(0.01, 0.02, 10),
            DeviationStatistics(0.02, 0.03, 10),
            Verdict.WORSE,
        ),  # although within limits
        (DeviationStatistics(0.01, 0.02, 10), DeviationStatistics(0.01, 0.02, 10), Verdict.PASS),
        (None, DeviationStatistics(0.012, 0.03, 10), Verdict.NOT_EVALUATED),
        (BEFORE, None, Verdict.NOT_EVALUATED),
        (None, None, Verdict.NOT_EVALUATED),
    ],
)
def test_verdicts(before, after, verdict):
    assert validate(before, after, **LIMITS) is verdict


@given(st.none() | spreads, st.none() | spreads)
def test_a_pass_needs_data_no_increase_and_both_limits(before, after):
    if validate(before, after, **LIMITS) is Verdict.PASS:
        assert before is not None
        assert after is not None
        assert after.mean_mm <= before.mean_mm
        assert after.mean_mm <= LIMITS["mean_mm"]
        assert after.largest_mm <= LIMITS["largest_mm"]


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf])
def test_nan_gives_no_statistics(broken):
    spread = DeviationStatistics.of([[0.01, 0.0, 0.0], [0.0, broken, 0.0]])
    assert validate(BEFORE, spread, **LIMITS) is Verdict.NOT_EVALUATED
    assert validate(spread, DeviationStatistics(0.01, 0.02, 1), **LIMITS) is Verdict.NOT_EVALUATED


def test_verdicts_read_as_words():
    assert [str(verdict) for verdict in Verdict] == [
        "pass",
        "out of limits",
        "worse than before",
        "not evaluated",
    ]


COUNTS = (35, 55, 5)


def test_the_outcome_line():
    line = calibration_outcome(
        COUNTS,
        DeviationStatistics(3.412, 6.0, 10),
        DeviationStatistics(0.0119, 0.03, 10),
        0.05,
        Verdict.PASS,
    )
    assert line == (
        "35 parameters, 55 records at 5 points; "
        "mean deviation at held-out points 3.41 -> 0.012 mm (limit 0.05): pass"
    )


@pytest.mark.parametrize(
    ("before", "after"),
    [(None, None), (DeviationStatistics(3.4, 6.0, 10), None), (None, DeviationStatistics(0.01, 0.03, 10))],
)
def test_missing_held_out_data_are_stated_and_do_not_pass(before, after):
    line = calibration_outcome(COUNTS, before, after, 0.05, Verdict.NOT_EVALUATED)
    assert line == "35 parameters, 55 records at 5 points; held-out points: not evaluated"


def test_the_outcome_of_a_check():
    found = DeviationStatistics(3.412, 6.0, 10)
    assert check_outcome(found, 0.05, Verdict.OUT_OF_LIMITS) == (
        "10 poses at held-out points; mean deviation 3.412 mm (limit 0.05): out of limits"
    )
    assert check_outcome(None, 0.05, Verdict.NOT_EVALUATED) == "held-out points: not evaluated"
