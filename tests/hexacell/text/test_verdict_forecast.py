"""What preflight says of the limits: how likely a healthy machine passes, and what would help."""

import numpy as np
import pytest

from hexacell.cell.measuring import AcceptanceSettings
from hexacell.dry_run.verdict_forecast import NOISE, VerdictForecast
from hexacell.text.planning import verdict_forecast_lines
from hexacell.verdict.decision import Verdict

NONE = dict.fromkeys(Verdict, 0.0)


def forecast(passed: float, part: str = NOISE, *, position: float = 0.2, orientation: float = 0.01):
    probabilities = NONE | {Verdict.PASS: passed, Verdict.CONDITIONAL_PASS: 1.0 - passed}
    passing = AcceptanceSettings(position_mm=position, orientation_deg=orientation)
    limits = AcceptanceSettings(position_mm=0.15, orientation_deg=0.05)
    return VerdictForecast(probabilities, limits, passing, part, 0.064, 0.072)


def test_limits_that_good_machines_fail_are_warned_of_with_what_would_do() -> None:
    first, warning = verdict_forecast_lines(forecast(0.62, "scale of each encoder", position=0.2031), 55)
    assert "probability of 62% (conditional pass 38%)" in first
    assert "95% would pass position_mm = 0.21 in [acceptance]. The largest part" in warning
    assert "is the scale of each encoder (0.064 of 0.072 mm): have it calibrated" in warning


def test_only_limits_that_are_too_small_are_named() -> None:
    for position, orientation, said in (
        (0.1, 0.0612, "would pass orientation_deg = 0.062 in"),
        (0.2, 0.06, "would pass position_mm = 0.2 and orientation_deg = 0.06 in"),
        (0.1, 0.01, "would pass the limits in"),
    ):
        _, warning = verdict_forecast_lines(forecast(0.5, position=position, orientation=orientation), 55)
        assert said in warning


def test_where_records_would_do_it_says_how_many() -> None:
    """The part of the noise falls with the root of their number, what it is compared with does not."""
    _, warning = verdict_forecast_lines(forecast(0.5), 55)
    assert "about 124 records instead of 55" in warning
    expected = np.hypot(0.064 * (55 / 124) ** 0.5, 0.033)
    assert expected == pytest.approx(0.15 / 0.2 * 0.072, rel=0.02)
