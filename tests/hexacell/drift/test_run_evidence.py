"""What a run says of the state: its evidence, and innovations of an unchanged robot, standard normal."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.drift.drift_watch import QUIET_RUNS, alarm_limit, sums_after, two_sided_run_length
from hexacell.drift.run_evidence import DIFFUSE, CarriedPosterior, RunEvidence, whiten_records
from hexacell.drift.single_cause import single_cause_test
from hexacell.identification.problem.prior import SystematicErrors
from hexacell.identification.thermal_expansion import ThermalExpansion
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import free_parameter_derivatives
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.drift.synthetic_runs import CAUSES, LinearRobot

UM_M_K = 23.0
WARMER_K = 4.0 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def constant_along_x(measured) -> SystematicErrors:
    """One cause: records at the left of the robot read more."""
    side = np.sign(measured.poses.positions[:, :1]) * np.array([0.02, 0.0, 0.0])
    return SystematicErrors(side[..., None], np.zeros((len(side), 3, 3)))


def test_it_is_that_of_the_identification_and_depends_little_on_the_linearization(identified) -> None:
    evidence = whiten_records(identified.problem, identified.free).evidence
    np.testing.assert_allclose(evidence.information, identified.solution.information, rtol=1e-9)
    np.testing.assert_allclose(
        np.linalg.solve(evidence.information, evidence.weighted), identified.free, atol=1e-4
    )
    # A drift of 0.02 mm in every parameter away, the estimate is the same to a tenth of a sigma.
    away = identified.free + 0.02 * np.random.default_rng(0).standard_normal(len(identified.free))
    evidence = whiten_records(identified.problem, away).evidence
    found = np.linalg.solve(evidence.information, evidence.weighted)
    sigma = np.sqrt(np.diag(np.linalg.inv(evidence.information)))
    assert (np.abs(found - identified.free) / sigma).max() < 0.1


def test_errors_of_one_run_count_as_noise_and_shared_ones_as_state(identified) -> None:
    free = identified.free
    alone = whiten_records(identified.problem, free, of_this_run=constant_along_x).evidence
    shared = whiten_records(replace(identified.problem, systematic=constant_along_x), free).evidence
    assert shared.information.shape == (36, 36)
    prior = CarriedPosterior.diffuse(35, 1).information
    marginal = np.linalg.inv(np.linalg.inv(shared.information + prior)[:35, :35])
    np.testing.assert_allclose(marginal, alone.information + prior[:35, :35], rtol=1e-6)


def test_legs_that_were_longer_by_heat_are_taken_out(visit, make_problem, hexaglide, paper) -> None:
    """The same records of a machine with longer legs: without temperatures it seems to have changed."""
    actual = hexaglide.normalize_frames(paper.actual)[0]
    longer = actual.vector.copy()
    longer[actual.parameters.slices["l"]] *= 1.0 + 1e-6 * UM_M_K * WARMER_K
    warm = visit(Geometry(actual.parameters, longer), seed=4).measured(0.01, seed=3)
    shown = MeasurementSet(
        tuple(replace(one, temperatures=(*WARMER_K.tolist(), None)) for one in warm.records)
    )
    free = hexaglide.convention.free_parameters(actual)
    causes, known = free_parameter_derivatives(hexaglide, actual), 1e-6 * np.eye(len(free))
    seen = single_cause_test(whiten_records(make_problem(warm), free), known, causes)
    problem = make_problem(shown, expansion=ThermalExpansion(UM_M_K, 0.0, (0.0,) * 7))
    corrected = single_cause_test(whiten_records(problem, free), known, causes)
    assert np.abs(seen.scores).max() > seen.limit
    assert np.abs(corrected.scores).max() < corrected.limit


def test_a_leg_that_changed_is_found_in_real_records(visit, make_problem, hexaglide, paper) -> None:
    actual = hexaglide.normalize_frames(paper.actual)[0]
    row = actual.parameters.names.index("l4")
    moved = actual.vector.copy()
    moved[row] += 0.31
    problem = make_problem(visit(Geometry(actual.parameters, moved), seed=4).measured(0.01, seed=3))
    free = hexaglide.convention.free_parameters(actual)
    causes = free_parameter_derivatives(hexaglide, actual)
    found = single_cause_test(whiten_records(problem, free), 1e-6 * np.eye(len(free)), causes)
    assert np.abs(found.scores).argmax() == row
    assert np.abs(found.scores[row]) > found.limit
    assert found.changes[row] == pytest.approx(0.31, abs=4 * found.sigmas[row])


@pytest.mark.parametrize(
    ("limit", "shift", "length"),
    [(4.0, 0.0, 168.0), (5.0, 0.0, 465.0), (4.0, 1.0, 8.38), (5.0, 1.0, 10.4), (5.0, 2.0, 4.01)],
)
def test_the_table_of_a_textbook(limit, shift, length) -> None:
    """Montgomery, Introduction to Statistical Quality Control, table 9.3: two-sided, k = 0.5."""
    assert two_sided_run_length(limit, shift) == pytest.approx(length, rel=0.003)


def test_drawn_sums_alarm_as_often() -> None:
    values = np.random.default_rng(1).standard_normal((4000, 400))
    sums: Array = np.zeros((2, 400))
    lengths: list[float] = []
    age = np.zeros(400)
    for row in values:
        sums, age = sums_after(sums, row), age + 1
        over = sums.max(axis=0) > 3.0
        lengths += age[over].tolist()
        sums, age = np.where(over, 0.0, sums), np.where(over, 0.0, age)
    assert np.mean(lengths) == pytest.approx(two_sided_run_length(3.0), rel=0.02)


@pytest.mark.parametrize("streams", [1, 42])
def test_the_limit_has_the_run_length_asked_for(streams) -> None:
    limit = alarm_limit(streams)
    assert two_sided_run_length(limit) == pytest.approx(streams * QUIET_RUNS, rel=1e-4)


ROBOTS = 400
NIGHTS = 12


@pytest.fixture(scope="module")
def scores() -> np.ndarray:
    """Of many unchanged robots: (robots, nights, causes)."""
    found: list[list[np.ndarray]] = []
    for seed in range(ROBOTS):
        posterior = CarriedPosterior.diffuse(6, 0)
        calibration, *nights = LinearRobot(seed).runs(NIGHTS)
        posterior = posterior.after(calibration)
        found.append([])
        for night in nights:
            found[-1].append(posterior.scores(night, CAUSES.by_state))
            posterior = posterior.after(night)
    return np.array(found)


def test_they_are_standard_normal_and_independent_of_those_before(scores) -> None:
    assert np.abs(scores.mean(axis=0)).max() < 4.0 / np.sqrt(ROBOTS)
    assert np.abs(scores.std(axis=0) - 1.0).max() < 4.0 / np.sqrt(2 * ROBOTS)
    products = np.einsum("rni,rmi->nm", scores, scores) / (ROBOTS * scores.shape[2])
    np.fill_diagonal(products, 0.0)
    assert np.abs(products).max() < 4.5 / np.sqrt(ROBOTS)


def test_before_a_calibration_nothing_is_said() -> None:
    night = next(LinearRobot().nights(1))
    assert np.isnan(CarriedPosterior.diffuse(6, 0).scores(night, CAUSES.by_state)).all()


def test_forgetting_a_cause_is_a_wide_prior_along_it() -> None:
    posterior = CarriedPosterior.diffuse(6, 0).after(next(LinearRobot().runs(0)))
    cause = np.array([1.0, 0.5, 0.0, 0.0, -1.0, 0.0])
    forgot = posterior.forgetting(cause[None])
    covariance = np.linalg.inv(posterior.information)
    np.testing.assert_allclose(forgot.state, posterior.state, atol=1e-6)
    np.testing.assert_allclose(
        np.linalg.inv(forgot.information), covariance + DIFFUSE**2 * np.outer(cause, cause), rtol=1e-6
    )


def test_shared_causes_cancel_between_runs() -> None:
    """What is the same in all runs is no change, however large; unknown to the watch it would be one."""
    random = np.random.default_rng(0)
    causes = np.concatenate([np.eye(6), np.zeros((6, 2))], axis=1)
    rows = random.standard_normal((2, 30, 8))
    state = np.concatenate([np.zeros(6), [3.0, -3.0]])

    def evidence(part: np.ndarray, columns: int):
        values = part @ state + random.standard_normal(30)
        known = part[:, :columns]
        return RunEvidence(known.T @ known, known.T @ values)

    aware = CarriedPosterior.diffuse(6, 2).after(evidence(rows[0], 8))
    unaware = CarriedPosterior.diffuse(6, 0).after(evidence(rows[0], 6))
    assert np.abs(aware.scores(evidence(rows[1], 8), causes)).max() < 3.5
    assert np.abs(unaware.scores(evidence(rows[1], 6), np.eye(6))).max() > 4.5
