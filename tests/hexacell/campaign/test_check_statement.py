"""Verdicts of a check, and how many more records would give one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from hexacell.cell.measuring import AcceptanceSettings
from hexacell.verdict.check_statement import (
    MOST_FURTHER_RECORDS,
    ErrorEstimate,
    guarded_verdict,
    records_to_decide,
)
from hexacell.verdict.decision import Verdict, decide_both

QUANTILE = float(np.sqrt(chi2.ppf(0.95, 3)))
NONE = np.zeros((1, 6, 0))
LIMITS = AcceptanceSettings(position_mm=0.15, orientation_deg=0.05, guard_band_factor=1.0)


def at_one_pose(error: tuple[float, float, float] = (0.0, 0.0, 0.0), sigma: float = 0.1) -> ErrorEstimate:
    """Three parameters that are the position error itself, with isotropic uncertainty."""
    jacobian = np.zeros((1, 6, 3))
    jacobian[0, :3] = np.eye(3)
    return ErrorEstimate(jacobian, np.array(error), sigma**2 * np.eye(3), NONE, np.zeros((1, 6)))


def verdict(likeliest: ErrorEstimate, guarded: ErrorEstimate) -> Verdict:
    return guarded_verdict(likeliest.errors, guarded.errors, LIMITS)


@pytest.mark.parametrize(
    ("likeliest", "guarded", "expected"),
    [
        (at_one_pose(sigma=0.03), at_one_pose(sigma=0.03), Verdict.PASS),
        (at_one_pose(sigma=0.03), at_one_pose(sigma=0.1), Verdict.CONDITIONAL_PASS),
        (at_one_pose((0.3, 0.0, 0.0), 0.03), at_one_pose((0.2, 0.0, 0.0), 0.1), Verdict.FAIL),
    ],
)
def test_a_pass_holds_for_both_estimates_and_a_fail_needs_the_likeliest_only(likeliest, guarded, expected):
    assert verdict(likeliest, guarded) is expected


def test_of_the_guarded_errors_a_pass_keeps_u_alone() -> None:
    """They are those of a larger drift already; the likeliest ones keep the whole guard band."""
    wide = LIMITS.model_copy(update={"guard_band_factor": 1.5})
    sure, unsure = at_one_pose(sigma=0.03), at_one_pose(sigma=0.05)
    assert decide_both(unsure.errors.position, unsure.errors.orientation, wide) is not Verdict.PASS
    assert guarded_verdict(sure.errors, unsure.errors, wide) is Verdict.PASS
    assert guarded_verdict(unsure.errors, unsure.errors, wide) is not Verdict.PASS


def test_an_orientation_out_of_limits_fails() -> None:
    turned = at_one_pose(sigma=0.001)
    jacobian = turned.jacobian.copy()
    jacobian[0, 3:] = np.eye(3)
    turned = replace(turned, jacobian=jacobian, difference=np.array([np.radians(0.2), 0.0, 0.0]))
    assert turned.errors.position.value < LIMITS.position_mm
    assert verdict(turned, turned) is Verdict.FAIL


def test_systematic_effects_count_beside_the_covariance() -> None:
    columns = np.zeros((1, 6, 3))
    columns[0, :3] = 0.04 * np.eye(3)
    both = replace(at_one_pose(sigma=0.03), systematic=columns)
    assert both.errors.position.expanded == pytest.approx(0.05 * QUANTILE, rel=0.02)
    assert both.after(1e9 * np.eye(3)).errors.position.expanded == pytest.approx(0.04 * QUANTILE, rel=0.02)


def test_the_forecast_is_the_first_number_with_which_the_interval_is_inside_for_both_estimates() -> None:
    # The variance after n records of information i is 1 / (100 + n i).
    needed = ((QUANTILE / 0.15) ** 2 - 100.0) / 20.0
    found, guarded = (
        records_to_decide(at_one_pose(), one, LIMITS, 20.0 * np.eye(3))
        for one in (at_one_pose(), at_one_pose(sigma=1.0))
    )
    assert found is not None
    assert found == pytest.approx(np.ceil(needed), abs=1)
    assert found is not None
    assert guarded is not None
    assert guarded > found


def test_an_error_as_large_as_the_limit_is_never_decided() -> None:
    on_limit = at_one_pose((0.15, 0.0, 0.0))
    assert records_to_decide(on_limit, on_limit, LIMITS, 20.0 * np.eye(3)) is None
    assert MOST_FURTHER_RECORDS >= 100
