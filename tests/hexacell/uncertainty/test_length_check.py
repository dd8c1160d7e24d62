"""The length by the robot against a certified one, on machines that are solved by leg equations alone."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.errors import IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.identification.problem.prior import Noise
from hexacell.uncertainty import effect_kinds
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.length_check import LengthCheck
from hexacell.uncertainty.length_records import JudgedGeometry, LengthRecords
from tests.hexacell.uncertainty.two_seats import TwoSeats

NOISE = Noise(0.01, 0.01)
ALONG = np.array([1.0, 0.0, 0.0])
DIRECTIONS = {
    "rails": (ALONG, (-150.0, 0.0, 500.0)),
    "across": (np.array([0.0, 1.0, 0.0]), (0.0, -150.0, 500.0)),
    "oblique": (np.array([0.6, 0.64, 0.48]), (-90.0, -100.0, 450.0)),
}


def seats(name: str = "rails", distance_mm: float = 300.0, **others) -> TwoSeats:
    direction, start = DIRECTIONS[name]
    return TwoSeats(distance_mm, direction, np.array(start), **others)


def ideal(paper):
    return lambda shown: (paper.actual, shown)


def scaled(paper, long_um_m):
    """Encoders that show so much more than the sliders move."""
    return lambda shown: (paper.actual, shown / (1.0 + 1e-6 * long_um_m))


def judged(found, columns=None) -> JudgedGeometry:
    return JudgedGeometry(found.free_covariance, columns or {})


def check_of(laboratory, found, machine, fixture) -> LengthCheck:
    records = fixture.records(laboratory, found, machine)
    return LengthCheck.of(records, fixture.standard(), NOISE, judged(found))


@pytest.mark.parametrize("name", DIRECTIONS)
@pytest.mark.parametrize("long_um_m", [1000.0, -300.0])
def test_a_scale_of_all_encoders_is_found_in_every_direction(laboratory, paper, name, long_um_m) -> None:
    """The identified geometry is larger by the scale, or nearly so; no residual shows it."""
    machine = scaled(paper, long_um_m)
    found = laboratory.identified(laboratory.records_of(machine))
    assert found.goodness.chi2 < 1.2 * found.goodness.expected
    scale = effect_kinds.common_encoder_scale(1.0)
    taken_up = {scale.name: laboratory.propagation(found).parameter_columns(scale)}
    fixture = seats(name)
    records = fixture.records(laboratory, found, machine)
    check = LengthCheck.of(records, fixture.standard(), NOISE, judged(found, taken_up))
    assert check.encoders_long_um_m == pytest.approx(long_um_m, rel=0.003)


@settings(max_examples=15)
@given(long_um_m=st.floats(-2000.0, 2000.0), distance_mm=st.floats(50.0, 300.0))
def test_along_the_rails_the_geometry_does_not_matter(laboratory, exact, paper, long_um_m, distance_mm):
    """The exact geometry with scaled encoders, and one that is wrong by tenths of a millimetre."""
    fixture = seats(distance_mm=distance_mm)
    for found in (exact, wrong(exact)):
        check = check_of(laboratory, found, scaled(paper, long_um_m), fixture)
        assert check.encoders_long_um_m == pytest.approx(long_um_m, abs=0.01 * abs(long_um_m) + 0.5)


def wrong(found):
    """The identification with another geometry."""
    free = found.free + 0.2 * np.random.default_rng(3).standard_normal(len(found.free))
    return replace(found, solution=replace(found.solution, prediction=replace(found.prediction, free=free)))


def test_the_covariance_of_the_geometry_counts_across_the_rails_alone(laboratory, exact, paper) -> None:
    along, across = (
        check_of(laboratory, exact, ideal(paper), seats(name)).lines["covariance of the geometry"]
        for name in ("rails", "across")
    )
    assert along < 0.5
    assert across > 20.0


def one_scale(paper, leg, um_m):
    factors = np.ones(6)
    factors[leg] += 1e-6 * um_m
    return lambda shown: (paper.actual, shown * factors)


@pytest.mark.parametrize("name", ["across", "rails"])
def test_an_effect_moves_the_result_as_is_propagated(laboratory, exact, paper, name) -> None:
    """Through the records of the identification and those of the check, for one encoder's scale."""
    effect, machine = effect_kinds.encoder_scales(1.0), one_scale(paper, 2, 200.0)
    propagation = laboratory.propagation(exact)
    columns = {effect.name: propagation.parameter_columns(effect)}
    fixture = seats(name)
    clean = fixture.records(laboratory, exact, ideal(paper))
    check = LengthCheck.of(clean, fixture.standard(), NOISE, judged(exact, columns), [effect])
    predicted = 200.0 * check.observation.by_effects[effect.name][2]
    found = laboratory.identified(laboratory.records_of(machine))
    records = fixture.records(laboratory, found, machine)
    same_weights = LengthCheck.of(records, fixture.standard(), NOISE, judged(exact, columns), [effect])
    assert -same_weights.encoders_long_um_m == pytest.approx(predicted, abs=3.0 + 0.05 * abs(predicted))
    assert abs(predicted) > 20.0


def test_each_line_is_what_its_source_does(laboratory, exact, paper) -> None:
    fixture = seats(seating_mm=0.004)
    records = fixture.records(laboratory, exact, ideal(paper))
    standard = fixture.standard(certificate_mm=0.0015, temperature_um_m=11.5, parallel=1e-4, height_mm=50.0)
    lines = LengthCheck.of(records, standard, NOISE, judged(exact)).lines
    assert lines["certificate"] == pytest.approx(1e6 * 0.0015 / 300.0)
    assert lines["temperature of the fixture"] == 11.5
    assert lines["angle between the seats"] == pytest.approx(1e6 * 5e-3 / 300.0)
    # Two mountings of the first seat, one of the second.
    assert lines["seating of the gauges"] == pytest.approx(1e6 * 0.004 * np.sqrt(1.5) / 300.0, rel=0.05)
    # At least the gauges' noise, averaged over 12 and 6 records.
    assert lines["noise of the readings"] > 1e6 * 0.01 * np.sqrt(1 / 12 + 1 / 6) / 300.0


@pytest.mark.slow
def test_u_covers_the_true_scale(laboratory, paper, visit, make_problem) -> None:
    """Calibrations and checks, every number drawn: noise of both, seating, fixture."""
    random = np.random.default_rng(7)
    fixture = seats("across", seating_mm=0.004)
    inside = []
    for seed in range(100):
        machine, certified = ideal(paper), 300.0 + 0.003 * random.standard_normal()
        found = identify(make_problem(visit(seed=2).measured(0.01, seed=seed)), find_outliers=False)
        records = fixture.records(laboratory, found, machine, 0.01, random)
        standard = replace(fixture.standard(certificate_mm=0.003), distance_mm=certified)
        check = LengthCheck.of(records, standard, NOISE, judged(found))
        inside.append(abs(check.encoders_long_um_m) <= check.expanded_um_m)
    assert 0.93 <= np.mean(inside) <= 0.98


def noisy_check(laboratory, found, paper, fixture, seed=3) -> LengthCheck:
    random = np.random.default_rng(seed)
    records = fixture.records(laboratory, found, ideal(paper), 0.01, random)
    return LengthCheck.of(records, fixture.standard(), NOISE, judged(found))


def test_a_good_check_agrees_with_itself_and_its_residuals_are_as_tested(laboratory, exact, paper) -> None:
    check = noisy_check(laboratory, exact, paper, seats(seating_mm=0.004))
    assert check.agreement.is_explained
    assert np.abs(check.closure_mm).max() < 0.06
    for followed in check.following().values():
        assert followed == pytest.approx([1.0, 1.0, 1.0], abs=0.2)
    fixture = seats("oblique", seating_mm=0.004)
    chances = [noisy_check(laboratory, exact, paper, fixture, n).agreement.probability for n in range(40)]
    assert 0.35 < np.mean(chances) < 0.65
    assert np.mean(np.array(chances) < 0.1) < 0.2


@pytest.mark.parametrize("shift", [(0.2, 0.0, 0.0), (0.0, -0.15, 0.1), (1.0, -0.8, 0.6)])
def test_gauges_that_are_zeroed_in_between_do_not_close(laboratory, exact, paper, shift) -> None:
    check = noisy_check(laboratory, exact, paper, seats(zeroed_mm=np.array(shift)))
    assert check.agreement.probability < 1e-6
    assert check.closure_mm == pytest.approx(shift, abs=0.06)


@pytest.mark.parametrize(("axis", "reversed_gauges"), [("z", [0, 1]), ("x", [1, 2])])
def test_gauges_the_wrong_way_round_run_against_the_ball(laboratory, exact, paper, axis, reversed_gauges):
    turned = Rotation.from_euler(axis, 180.0, degrees=True)
    check = noisy_check(laboratory, exact, paper, seats(turned=turned))
    assert check.agreement.probability < 1e-6
    followed = check.following()
    assert np.flatnonzero(followed[2] < 0.0).tolist() == reversed_gauges
    assert all((followed[mounting] > 0.8).all() for mounting in (1, 3))


def test_a_ball_that_never_moved_says_nothing_and_other_joints_are_refused(laboratory, exact, paper):
    records = seats().records(laboratory, exact, ideal(paper))
    placement = records.placement
    kept = np.flatnonzero(np.abs(placement.deviations).max(axis=1) < 0.1)
    rows = {name: getattr(placement, name)[kept] for name in ("poses", "joints", "deviations")}
    still = LengthRecords(records.mountings[kept], replace(placement, **rows))
    followed = LengthCheck.of(still, seats().standard(), NOISE, judged(exact)).following()
    assert all(np.isnan(one).all() for one in followed.values())
    wrong = replace(records.placement, joints=records.placement.joints * [1, -1, 1, -1, 1, -1])
    with pytest.raises(IdentifiabilityError, match="do not belong to the commanded poses"):
        LengthRecords.of(wrong, records.mountings)


def measured_budget(laboratory, found, machine, fixture, effects):
    """The budget before and after a length check, and what the check observed."""
    propagation = laboratory.propagation(found)
    before = UncertaintyBudget.of(propagation, effects)
    records = fixture.records(laboratory, found, machine)
    known = judged(found, before.parameter_columns)
    check = LengthCheck.of(records, fixture.standard(certificate_mm=0.001), NOISE, known, effects)
    after = UncertaintyBudget.of(propagation, effects, check.observation)
    return before, after, check.observation


EFFECTS = (
    effect_kinds.common_encoder_scale(1000.0),
    effect_kinds.encoder_scales(10.0),
    effect_kinds.rail_directions(0.02),
    effect_kinds.rail_waves(3.0, 600.0),
    effect_kinds.common_sag(10.0, 800.0),
    effect_kinds.stop_repeatability(2.0),
    effect_kinds.ball_roundness(2.0),
)


@pytest.mark.parametrize("name", ["rails", "oblique"])
def test_what_a_measured_scale_does_at_the_task_is_known(laboratory, paper, name) -> None:
    """1e-3 of all encoders, against the machine commanded with what was found of it."""
    machine = scaled(paper, 1000.0)
    found = laboratory.identified(laboratory.records_of(machine))
    before, after, _ = measured_budget(laboratory, found, machine, seats(name), EFFECTS)
    true = laboratory.task_errors(machine, found.geometry)
    nothing = np.zeros(len(found.free))
    assert np.linalg.norm(true[:, :3], axis=1).max() > 0.02
    assert before.errors_of(nothing).estimated == pytest.approx(0.0)
    assert after.errors_of(nothing).estimated[:, :3] == pytest.approx(true[:, :3], abs=0.01)


def test_what_the_check_shares_with_the_estimate_is_not_counted_as_independent(laboratory, exact, paper):
    """Linear draws of every cause: the error at the task less what is stated, against the budget's."""
    effects = (effect_kinds.common_encoder_scale(30.0), effect_kinds.encoder_scales(50.0))
    _, after, observed = measured_budget(laboratory, exact, ideal(paper), seats("oblique"), effects)
    propagation = laboratory.propagation(exact)
    random = np.random.default_rng(4)
    factor = np.linalg.cholesky(exact.free_covariance + 1e-18 * np.eye(len(exact.free)))
    noise, each, alone = (random.standard_normal((4000, n)) for n in (len(exact.free), 6, 1))
    by_noise, by_each = noise @ factor.T, 50.0 * each
    unit = propagation.columns(effects[0]).combined[..., 0]
    stated = by_noise @ observed.by_parameters + by_each @ observed.by_effects[effects[1].name]
    stated = stated + observed.sigma_um_m * alone[:, 0]
    errors = -by_noise @ np.swapaxes(propagation.jacobian, 1, 2)
    errors = errors + by_each @ np.swapaxes(propagation.columns(effects[1]).combined, 1, 2)
    left = np.moveaxis(errors, 0, 1) - stated[:, None, None] * unit
    largest = np.linalg.norm(left[..., :3], axis=-1).max(axis=1)
    assert after.expanded_mm == pytest.approx(np.quantile(largest, 0.95), rel=0.04)
