"""Run lengths against published tables, against an approximation, and against drawn sums."""

import numpy as np
import pytest

from hexacell.drift.drift_watch import REFERENCE, CumulativeSums, limit_for_run_length, two_sided_run_length


@pytest.mark.parametrize(
    ("limit", "shift", "length"),
    [(4.0, 0.0, 168.0), (5.0, 0.0, 465.0), (4.0, 1.0, 8.38), (5.0, 1.0, 10.4), (5.0, 2.0, 4.01)],
)
def test_the_table_of_a_textbook(limit, shift, length) -> None:
    """Montgomery, Introduction to Statistical Quality Control, table 9.3: two-sided, k = 0.5."""
    assert two_sided_run_length(limit, 0.5, shift) == pytest.approx(length, rel=0.003)


def test_drawn_sums_alarm_as_often() -> None:
    values = np.random.default_rng(1).standard_normal((4000, 400))
    sums, lengths = CumulativeSums.at_rest(400), []
    age = np.zeros(400)
    for row in values:
        sums, age = sums.after(row), age + 1
        over = sums.largest > 3.0
        lengths += age[over].tolist()
        up, down = np.where(over, 0.0, sums.up), np.where(over, 0.0, sums.down)
        sums, age = CumulativeSums(up, down), np.where(over, 0.0, age)
    assert np.mean(lengths) == pytest.approx(two_sided_run_length(3.0, REFERENCE), rel=0.02)


@pytest.mark.parametrize("streams", [1, 42])
def test_the_limit_has_the_run_length_asked_for(streams) -> None:
    limit = limit_for_run_length(3650.0, REFERENCE, streams)
    assert two_sided_run_length(limit, REFERENCE) == pytest.approx(streams * 3650.0, rel=1e-4)
