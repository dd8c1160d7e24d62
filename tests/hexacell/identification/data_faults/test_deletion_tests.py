"""A cause is named only where the rest of the records proves it."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.data_faults import messages
from hexacell.identification.data_faults import stepwise_selection as proof
from hexacell.identification.data_faults.corrected_fit import LARGEST_TRUSTED_RATIO, CorrectedFit
from hexacell.identification.data_faults.hypotheses import ALL_IN_INCHES, GAUGE_FAULTS
from hexacell.identification.data_faults.stepwise_selection import (
    UncorrectableFaultError,
    confirmed_by_refit,
    refitted,
    required_significance,
    select_faults,
)
from hexacell.identification.estimator import identify
from hexacell.identification.solver.chi_square import ChiSquareTest, ChiSquareVerdict
from hexacell.identification.solver.fit import QUICK, fit_regularized
from hexacell.identification.solver.result import DataFaultKind, GaugeFaultError
from hexacell.uncertainty.possible_causes import possible_causes
from tests.hexacell.altered_records import altered
from tests.hexacell.conftest import ACTUAL


def with_encoders(measurements, error):
    """Joint variables q (6,) that are wrong by ``error(q)``: an imperfect machine with true gauges."""
    return altered(measurements, lambda r: {"joints": r.joints + error(np.array(r.joints))})


def waves(seed, amplitude_mm):
    random = np.random.default_rng(seed)
    random.standard_normal(18)
    phases = random.uniform(0.0, 6.0, 6)
    return lambda joints: amplitude_mm * np.sin(joints / 60.0 + phases)


IMPERFECT = [waves(2, 0.03), waves(5, 0.1)]


def scatter(seed, sigma_mm):
    random = np.random.default_rng(seed)
    return lambda _: sigma_mm * random.standard_normal(6)


FAR_FROM_ANY_MODEL = [
    pytest.param(waves(5, 1.0), marks=pytest.mark.slow),
    pytest.param(scatter(1, 0.5), marks=pytest.mark.slow),
]


@pytest.mark.parametrize("error", [*IMPERFECT, *FAR_FROM_ANY_MODEL])
def test_an_imperfect_machine_is_not_blamed_on_its_records(noisy, make_problem, error):
    found = identify(make_problem(with_encoders(noisy, error)))
    assert found.data_faults == ()
    assert found.records == len(noisy)
    assert found.goodness.agreement is ChiSquareVerdict.TOO_LARGE


@pytest.mark.parametrize("error", IMPERFECT)
def test_a_large_gross_error_in_an_imperfect_machine_is_named(noisy, make_problem, spoil, error):
    spoilt = spoil(with_encoders(noisy, error), (4, 4), deviation=(0.0, 3.0, 0.0))
    (fault,) = identify(make_problem(spoilt)).data_faults
    assert fault.kind is DataFaultKind.GROSS_ERROR
    assert fault.left_out == ((4, 4),)


@pytest.mark.parametrize("error", [IMPERFECT[0], *FAR_FROM_ANY_MODEL])
def test_gauges_reversed_in_an_imperfect_machine_are_named(noisy, make_problem, error):
    wrong = altered(with_encoders(noisy, error), lambda r: {"deviation": np.negative(r.deviation)})
    with pytest.raises(GaugeFaultError) as raised:
        identify(make_problem(wrong))
    assert raised.value.fault.kind is DataFaultKind.REVERSED


@pytest.mark.parametrize(("records", "named"), [(8, False), (10, True)])
def test_a_slip_is_named_only_with_equations_to_spare(visit, make_problem, records, named):
    """Split at the slip, 2 x 10 records give 51 equations for 35 parameters; 2 x 9 only 45."""
    few = visit(points=2, orientations=records, seed=81).measured(0.01, seed=81)
    slipped = altered(
        few,
        lambda r: {"deviation": np.add(r.deviation, [0.0, 1.5, 0.5])},
        lambda r: r.point == 1 and r.orientation >= 4,
    )
    problem = make_problem(slipped)
    if named:
        with pytest.raises(GaugeFaultError, match="slipped before orientation 4"):
            identify(problem)
    else:
        found = identify(problem)
        assert found.data_faults == ()
        assert found.goodness.agreement is ChiSquareVerdict.TOO_LARGE


@pytest.mark.parametrize(
    ("chi2", "faults", "required"),
    [
        (100.0, 1, proof.BESIDE_GOOD),
        (100.0, 2, proof.BESIDE_AGREEING),  # more faults chosen: less of a proof
        (130.0, 1, proof.BESIDE_AGREEING),  # probability 0.02
        (200.0, 1, proof.BESIDE_DISAGREEING),
    ],
)
def test_the_less_the_rest_agrees_the_more_significant_a_fault_must_be(chi2, faults, required):
    assert required_significance(ChiSquareTest(chi2, 100.0), faults) == required


def test_a_lost_record_counts_once_in_the_mean(noisy, make_problem):
    problem = make_problem(noisy)
    rows = np.arange(problem.records) >= 3
    fit = fit_regularized(problem.subset(rows))
    current = CorrectedFit(problem, problem, fit)
    assert current.lost == 3
    expected = (fit.goodness.ratio**2 * 52 + LARGEST_TRUSTED_RATIO**2 * 3) / 55
    assert current.misfit == pytest.approx(expected)
    assert CorrectedFit(problem, problem.subset(rows), fit).misfit == pytest.approx(fit.goodness.ratio**2)


def test_one_lost_record_does_not_make_a_fit_better_by_far_than_one_that_has_it(noisy, make_problem):
    problem = make_problem(noisy)
    whole = CorrectedFit.uncorrected(problem)
    rows = np.arange(problem.records) > 0
    lost = CorrectedFit(problem, problem, fit_regularized(problem.subset(rows)))
    assert not whole.is_better_by_far_than(lost)
    in_mm = ALL_IN_INCHES.corrected(problem)
    assert whole.is_better_by_far_than(CorrectedFit.fitted(problem, in_mm, (ALL_IN_INCHES,)))


@pytest.mark.parametrize(
    ("before_mm", "after_mm", "gain", "confirmed"),
    [
        (0.1, 0.05, 0.5, False),  # fewer residuals, and still far too large
        (0.1, 0.0, 0.5, True),  # the corrected records agree
        (1.0, 0.05, 0.5, True),  # far better, and something else is wrong as well
        (0.02, 0.015, 0.0, False),  # near zero, readings with another sign are nearly the same readings
    ],
)
def test_a_gauge_fault_is_confirmed_by_agreement_or_by_far_smaller_residuals(
    noisy, make_problem, monkeypatch, before_mm, after_mm, gain, confirmed
):
    def fitted(amplitude_mm):
        problem = make_problem(with_encoders(noisy, waves(5, amplitude_mm)))
        return CorrectedFit(problem, problem, fit_regularized(problem))

    current, corrected = fitted(before_mm), fitted(after_mm)
    assert not current.is_consistent
    assert corrected.is_consistent is (after_mm < 0.05)
    assert corrected.fit.goodness.chi2 < (1.0 - gain) * current.fit.goodness.chi2
    monkeypatch.setattr(CorrectedFit, "fitted", lambda *_: corrected)
    found = confirmed_by_refit(current, replace(ALL_IN_INCHES, gain=gain * current.fit.goodness.chi2))
    assert found is (corrected if confirmed else None)


def test_a_correction_that_loses_most_records_is_not_better(noisy, make_problem):
    """As when deviations in micrometres look exchanged: what is left then agrees with anything."""
    problem = make_problem(noisy)
    wrong = ALL_IN_INCHES.corrected(problem)
    current = CorrectedFit.uncorrected(wrong)
    rows = np.arange(problem.records) % 5 == 0
    few = CorrectedFit(problem, problem, fit_regularized(problem.subset(rows)))
    assert few.lost == problem.records - rows.sum()
    assert few.misfit_beside(current) > 0.5 * current.misfit
    assert not few.is_better_by_far_than(current)


@pytest.mark.parametrize(
    ("left_mm", "cut_short", "named"),
    [
        ([1.0], False, "inches at every point: "),  # beside a machine that no model explains
        ([1.0], True, None),  # a longer fit explains as much of such a machine
        ([1.0, 0.0], False, "inches at every point and gauge x looks reversed"),
        ([0.0], True, None),  # a longer fit explains a healthy robot, far from its drawing
    ],
)
def test_gauge_faults_are_named_if_together_they_and_nothing_else_explain_the_records(
    noisy, make_problem, monkeypatch, left_mm, cut_short, named
):
    faults = (ALL_IN_INCHES, replace(ALL_IN_INCHES, gauge_fault=GAUGE_FAULTS[5]))
    right = [CorrectedFit.uncorrected(make_problem(with_encoders(noisy, waves(5, mm)))) for mm in left_mm]
    searched = (replace(fit, faults=faults[:number]) for number, fit in enumerate(right, 1))
    monkeypatch.setattr(proof, "_searched", lambda _: next(searched, None))
    monkeypatch.setattr(proof, "restarts", lambda _: iter(()))
    wrong = ALL_IN_INCHES.corrected(right[0].problem)
    records, far = right[0].problem if cut_short else wrong, fit_regularized(wrong, QUICK)
    if named is None:
        found = select_faults(records, far).selected
        assert (found.faults, found.is_consistent) == ((), left_mm == [0.0])
        return
    with pytest.raises(UncorrectableFaultError) as raised:
        select_faults(records, far)
    assert named in messages.refused(raised.value).sentence


def test_a_gauge_fault_needs_equations_that_could_contradict_it(visit, make_problem):
    few, many = (visit(points=2, orientations=n, seed=81).measured(0.01, seed=81) for n in (8, 9))
    assert refitted(CorrectedFit.uncorrected(make_problem(few)), ALL_IN_INCHES) is None
    assert refitted(CorrectedFit.uncorrected(make_problem(many)), ALL_IN_INCHES) is not None


@pytest.mark.parametrize(
    ("before", "after_mm", "settled"),
    [
        (ALL_IN_INCHES, 0.0, True),
        (ALL_IN_INCHES, 0.03, True),  # an imperfect machine with true gauges
        (ALL_IN_INCHES, 0.1, False),  # better by far, but something else is wrong
        (None, 0.03, False),  # not much better
    ],
)
def test_a_trial_that_leaves_an_imperfect_machine_settles_the_search(
    noisy, make_problem, before, after_mm, settled
):
    problem = make_problem(with_encoders(noisy, waves(5, after_mm)))
    after = CorrectedFit(problem, problem, fit_regularized(problem))
    wrong = make_problem(with_encoders(noisy, waves(5, 0.1)))
    wrong = wrong if before is None else before.corrected(wrong)
    assert after.settles(CorrectedFit(wrong, wrong, fit_regularized(wrong))) is settled


@pytest.mark.sample("0")
@pytest.mark.parametrize("seed", range(3))
def test_no_gauge_is_blamed_where_deviations_are_near_zero(visit, make_problem, seed):
    """A calibrated machine with a little of everything: reversed readings would be nearly the same."""
    records = visit(ACTUAL, ACTUAL, degrees=20.0, seed=seed).measured(0.01, seed)
    found = identify(make_problem(with_encoders(records, waves(seed, 0.03))))
    assert found.data_faults == ()
    assert not [one.name for one in possible_causes(found) if one.name.startswith("reversed")]
