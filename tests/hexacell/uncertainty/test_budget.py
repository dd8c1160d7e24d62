"""The budget has every line, and U is the quantile of the distributions that have a closed form."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.uncertainty import effect_kinds
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.statement import LargestError, TaskErrors
from hexacell.verdict.check_statement import ErrorEstimate

error_estimate = partial(ErrorEstimate, known=np.zeros(6))

GAUGE_SCALE = 2e-3


@pytest.fixture(scope="module")
def budget_of(laboratory):
    def budget(found, effects=(), earlier=None):
        return UncertaintyBudget.of(laboratory.propagation(found, earlier), effects)

    return budget


EFFECTS = (
    effect_kinds.encoder_scales(10.0),
    effect_kinds.rail_waves(5.0, 600.0),
    effect_kinds.stop_repeatability(2.0),
    effect_kinds.ball_roundness(2.0),
)


def test_without_effects_it_is_the_noise_alone(exact, propagation, budget_of) -> None:
    budget = budget_of(exact)
    jacobian = propagation.jacobian
    by_covariance = np.zeros(len(exact.free)), exact.free_covariance
    noise = error_estimate(jacobian, *by_covariance, np.zeros((len(jacobian), 6, 0))).errors
    assert budget.expanded_mm == pytest.approx(noise.position.expanded)
    assert budget.expanded_deg == pytest.approx(noise.orientation.expanded)
    squares = np.einsum("tap,pq,taq->t", jacobian[:, :3], exact.free_covariance, jacobian[:, :3])
    assert budget.noise_mm == pytest.approx(np.sqrt(squares.max()))
    assert budget.standard_mm == budget.noise_mm
    assert budget.systematic_mm == 0.0


def test_squares_of_all_lines_are_added_at_every_pose(exact, budget_of) -> None:
    budget = budget_of(exact, EFFECTS)
    columns = [budget.noise, *(line.columns for line in budget.lines)]
    each = sum((part[:, :3] ** 2).sum(axis=(1, 2)) for part in columns)
    assert budget.standard_mm == pytest.approx(np.sqrt(np.max(each)))
    assert np.linalg.norm(budget.parts_mm) == pytest.approx(budget.standard_mm)
    assert len(budget.parts_mm) == 1 + len(budget.lines)
    flat = np.concatenate([line.columns.reshape(12, -1) for line in budget.lines], axis=1)
    systematic = budget.systematic.reshape(12, -1)
    assert systematic.shape[1] <= 12
    assert systematic @ systematic.T == pytest.approx(flat @ flat.T, abs=1e-15)


def test_an_estimated_effect_is_taken_out_of_the_noise_and_listed(laboratory, budget_of) -> None:
    """The covariance of the estimate already contains the gauges' scale: nothing is counted twice."""
    noise = Noise(0.01, 0.01, gauge_scale=GAUGE_SCALE)
    measured = laboratory.visits.measured()
    found = identify(laboratory.make_problem(measured, noise=noise), find_outliers=False)
    plain = budget_of(found)
    listed = budget_of(found, [effect_kinds.gauge_scales(1e3 * GAUGE_SCALE, is_estimated=True)])
    assert listed.lines[0].combined_mm > 0.0
    assert listed.noise_mm < plain.noise_mm
    assert listed.standard_mm == pytest.approx(plain.standard_mm)
    assert listed.not_in_covariance.shape[-1] == 0


def test_residuals_larger_than_the_noise_widen_the_noise_line(laboratory, visit, budget_of) -> None:
    found = laboratory.identified(visit(seed=2).measured(0.03, seed=1))
    assert found.goodness.noise_factor > 2.0
    as_stated = replace(found, solution=replace(found.solution, chi2=found.goodness.expected))
    factor = budget_of(found).noise_mm / budget_of(as_stated).noise_mm
    assert factor == pytest.approx(found.goodness.noise_factor)


def test_what_no_record_shows_is_listed(visit, make_problem, paper, budget_of) -> None:
    """From records whose ball hardly leaves its zero, as of a calibrated robot."""
    exact = visit(commanding=paper.actual, degrees=40.0).measured()
    near = identify(make_problem(exact, controller=paper.actual), find_outliers=False)
    effects = (
        *EFFECTS,
        effect_kinds.rail_directions(0.02),
        effect_kinds.rail_waves(5.0, 1500.0),
        effect_kinds.common_encoder_scale(0.0),
        effect_kinds.common_sag(0.0, 800.0),
        effect_kinds.ball_beside_tool(0.0),
    )
    unseen = budget_of(near, effects).unseen
    assert {line.effect.name for line in unseen} == {
        "scale common to all encoders",
        "sag common to all rails",
        "ball beside the tool's centre",
    }
    assert all(line.combined_mm == 0.0 < line.per_unit_mm for line in unseen)


def test_a_geometry_beside_the_estimate_errs_by_the_difference_with_the_same_uncertainty(
    exact, propagation, budget_of
) -> None:
    budget = budget_of(exact, EFFECTS)
    difference = 0.05 * np.random.default_rng(3).standard_normal(len(exact.free))
    errors = budget.errors_of(difference)
    moved = np.linalg.norm(propagation.jacobian[:, :3] @ difference, axis=1).max()
    assert errors.position.value == pytest.approx(moved)
    assert (errors.effects**2).sum() == pytest.approx(
        (budget.noise**2).sum() + (budget.systematic**2).sum()
    )


def test_a_budget_with_an_earlier_one_has_its_effects_on_the_prior(laboratory, exact, visit, budget_of):
    """Without them, a short update of a calibrated robot would seem to err by all that cancels."""
    updated = laboratory.updated(exact, visit(points=2, orientations=6, seed=5).measured())
    effects = (effect_kinds.encoder_scales(10.0),)
    first = budget_of(exact, effects)
    shared, lost = (budget_of(updated, effects, earlier) for earlier in (first.parameter_columns, None))
    assert shared.systematic_mm < 1.5 * first.systematic_mm
    assert lost.systematic_mm > 1.5 * shared.systematic_mm


def errors(estimated, effects):
    return TaskErrors(np.asarray(estimated, dtype=float), np.asarray(effects, dtype=float))


def isotropic(sigma: float) -> np.ndarray:
    effects = np.zeros((1, 6, 3))
    effects[0, :3] = sigma * np.eye(3)
    return effects


def test_without_effects_nothing_is_uncertain_and_one_pose_has_the_quantile_of_its_distribution() -> None:
    stated = errors([[3.0, 4.0, 0.0, 0.0, 0.0, np.radians(2.0)]], np.zeros((1, 6, 0)))
    assert stated.position == LargestError(5.0, 0.0)
    assert stated.orientation.value == pytest.approx(2.0)
    position = errors(np.zeros((1, 6)), isotropic(0.02)).position
    assert position.value == 0.0
    assert position.expanded == pytest.approx(0.02 * np.sqrt(chi2.ppf(0.95, 3)), rel=0.02)
    stated = errors([[1.0, 2.0, 2.0, 0.0, 0.0, 0.0]], isotropic(0.5)).position
    low, high = (stated.value + sign * stated.expanded for sign in (-1.0, 1.0))
    inside = [ncx2.cdf((edge / 0.5) ** 2, 3, (3.0 / 0.5) ** 2) for edge in (low, high)]
    assert inside[1] - inside[0] == pytest.approx(0.95, abs=0.006)


def test_the_largest_of_independent_poses_is_more_uncertain_than_each() -> None:
    effects = np.zeros((2, 6, 2))
    effects[0, 0, 0] = effects[1, 0, 1] = 1.0
    both = errors(np.zeros((2, 6)), effects).position.expanded
    # P(max of two |z| <= q) = P(|z| <= q)^2.
    assert both == pytest.approx(np.sqrt(chi2.ppf(np.sqrt(0.95), 1)), rel=0.02)


def test_a_covariance_and_the_same_effects_give_the_same_statement() -> None:
    random = np.random.default_rng(3)
    jacobian, factor = random.standard_normal((4, 6, 5)), random.standard_normal((5, 5))
    difference = random.standard_normal(5)
    by_covariance = error_estimate(jacobian, difference, factor @ factor.T, np.zeros((4, 6, 0))).errors
    by_effects = error_estimate(jacobian, difference, np.zeros((5, 5)), jacobian @ factor).errors
    assert by_covariance.position.value == pytest.approx(by_effects.position.value)
    assert by_covariance.position.expanded == pytest.approx(by_effects.position.expanded, rel=0.03)
    assert by_covariance.worst == by_effects.worst
