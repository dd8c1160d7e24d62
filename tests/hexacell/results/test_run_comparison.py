"""Two results compared, and the trend over many: chance is not called a change, a change is not missed."""

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from hexacell.errors import UsageError
from hexacell.identification.solver.result import Termination
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS as PARAMETERS
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.results.result import IdentificationResult
from hexacell.results.run_comparison import compare_results, trends

NAMES = PARAMETERS.names
NOON = datetime(2026, 11, 20, 12, 0, tzinfo=UTC)
FIXED = [NAMES.index(name) for name in ("S2x", "S2y", "S2z", "S3z", "B2y", "B2z", "B3z")]
"""What a frame convention fixes has no variance."""


def covariance(seed: int = 7) -> Any:
    """Of strongly correlated parameters, mm^2."""
    factor = np.random.default_rng(seed).normal(size=(42, 42)) * 0.01
    factor[FIXED] = 0.0
    return factor @ factor.T


def result(values: Any, cov: Any = None, frame: str = "paper") -> IdentificationResult:
    cov = covariance() if cov is None else cov
    return IdentificationResult(
        converged=True,
        termination=next(iter(Termination)),
        iterations=5,
        records=55,
        points=5,
        residual_rms_mm=0.01,
        chi2=115.0,
        dof=115,
        geometry=PARAMETERS.document(np.asarray(values)),
        sigma=PARAMETERS.document(np.sqrt(np.diag(cov))),
        covariance=tuple(map(tuple, cov.tolist())),
        undetermined=(),
        outliers=(),
        frame=frame,
    )


def drawn(count: int) -> Any:
    """Results of one machine that does not change."""
    return np.random.default_rng(3).multivariate_normal(np.full(42, 100.0), covariance(), size=count)


def test_the_chi_square_of_an_unchanged_machine_is_the_number_of_free_parameters() -> None:
    values = drawn(400)
    tests = [compare_results(PARAMETERS, result(a), result(b)).test for a, b in values.reshape(-1, 2, 42)]
    assert {test.expected for test in tests} == {35.0}
    assert np.mean([test.chi2 for test in tests]) == pytest.approx(35.0, abs=2.0)
    assert np.std([test.chi2 for test in tests]) == pytest.approx(np.sqrt(70.0), rel=0.2)


def test_a_change_is_found_and_named_and_noise_is_no_change() -> None:
    before, after = drawn(2)
    compared = compare_results(PARAMETERS, result(before), result(after))
    assert not compared.is_changed
    assert len(compared.parameters) == 35
    assert {"S2x", "B3z"}.isdisjoint(one.name for one in compared.parameters)
    row = NAMES.index("l3")
    after[row] += 0.5
    compared = compare_results(PARAMETERS, result(before), result(after))
    assert compared.is_changed
    most = compared.significant[0]
    assert (most.name, most.unit, most.change) == ("l3", "mm", after[row] - before[row])
    assert most.sigma == pytest.approx(np.sqrt(2.0 * covariance()[row, row]))


def test_a_change_that_no_parameter_shows_alone_is_found() -> None:
    """The sum of two lengths may be known far better than each of them."""
    cov = np.zeros((42, 42))
    first, second = NAMES.index("l1"), NAMES.index("l2")
    cov[np.ix_([first, second], [first, second])] = [[1.0, -0.99999], [-0.99999, 1.0]]
    before, after = np.full(42, 100.0), np.full(42, 100.0)
    after[[first, second]] += 0.5
    compared = compare_results(PARAMETERS, result(before, cov), result(after, cov))
    assert compared.is_changed
    assert compared.significant == ()


def test_other_frames_are_not_compared() -> None:
    one, other = result(np.zeros(42)), result(np.zeros(42), frame="another")
    with pytest.raises(UsageError, match="different frame conventions"):
        compare_results(PARAMETERS, one, other)
    with pytest.raises(UsageError, match="different frame conventions"):
        trends(PARAMETERS, [(NOON, one), (NOON, other)])


def test_a_steady_parameter_walks_and_the_others_do_not() -> None:
    days = [0, 7, 20, 33, 60, 90]
    values = drawn(len(days))
    values[:, NAMES.index("B4y")] += 0.01 * np.array(days)
    found = trends(
        PARAMETERS,
        [(NOON + timedelta(days=day), result(row)) for day, row in zip(days, values, strict=True)],
    )
    assert len(found) == 35
    assert [one.name for one in found if one.is_walking] == ["B4y"]
    walking = next(one for one in found if one.is_walking)
    assert walking.per_day == pytest.approx(0.01, abs=3.0 * walking.sigma_per_day)
    assert walking.values == tuple(values[:, NAMES.index("B4y")])


def test_a_slope_has_the_spread_that_is_stated() -> None:
    at = [NOON + timedelta(days=day) for day in (0, 10, 25)]
    row, slopes = NAMES.index("l1"), []
    for values in drawn(900).reshape(-1, 3, 42):
        found = trends(PARAMETERS, [(when, result(one)) for when, one in zip(at, values, strict=True)])
        trend = next(one for one in found if one.name == NAMES[row])
        slopes.append(trend.per_day / trend.sigma_per_day)
    assert np.mean(slopes) == pytest.approx(0.0, abs=0.2)
    assert np.std(slopes) == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("days", [(), (0,), (0, 10), (0, 0, 0)])
def test_too_few_runs_tell_no_trend(days: tuple[int, ...]) -> None:
    assert trends(PARAMETERS, [(NOON + timedelta(days=day), result(np.zeros(42))) for day in days]) == ()


def test_parameters_that_the_convention_ties_count_once() -> None:
    """B2z, B3z and B5z are one number, as are B2y and B5y: of 38 that change 35 are free."""
    basis = Hexaglide().convention.basis
    random = np.random.default_rng(4)
    factor = 0.01 * random.standard_normal((35, 35))
    free = factor @ factor.T
    change = random.multivariate_normal(np.zeros(35), 2.0 * free)
    tied = basis @ free @ basis.T
    values = np.full(42, 100.0)
    found = compare_results(PARAMETERS, result(values, tied), result(values + basis @ change, tied))
    assert len(found.parameters) == 38
    assert found.test.expected == 35.0
    assert found.test.chi2 == pytest.approx(change @ np.linalg.solve(2.0 * free, change), rel=1e-4)
