"""Bad records are found, named and left out; good records are kept."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.identification.data_faults.corrected_fit import CorrectedFit
from hexacell.identification.data_faults.hypotheses import OutlierHypothesis, ZeroShiftHypothesis
from hexacell.identification.data_faults.units import wrong_unit
from hexacell.identification.estimator import identify
from hexacell.identification.solver.result import DataFaultKind, GaugeFaultError
from hexacell.measurements.records import MeasurementSet
from tests.hexacell.altered_records import altered


def without(measurements, *labels):
    kept = [record for record in measurements.records if (record.point, record.orientation) not in labels]
    return MeasurementSet(tuple(kept))


def named(found):
    return {record for record, _ in found.left_out}


@pytest.mark.parametrize(
    ("label", "error"),
    [
        ((3, 7), {"deviation": (0.0, 0.0, 0.5)}),
        ((5, 11), {"deviation": (-0.3, 0.2, 0.0)}),
        ((1, 1), {"deviation": (0.0, 0.5, 0.0)}),  # the reference is a record like the others
        ((4, 2), {"joints": (0, 0, 0, 0.3, 0, 0)}),
        ((2, 9), {"joints": (20.0, 0, 0, 0, 0, -10.0)}),
        ((2, 4), {"joints": (-300, -300, -300, 300, 300, 300)}),  # of no pose, so without a residual
    ],
)
def test_a_bad_record_is_named_and_does_not_change_the_result(noisy, spoil, make_problem, label, error):
    found = identify(make_problem(spoil(noisy, label, **error)))
    assert named(found) == {label}
    clean = identify(make_problem(without(noisy, label)))
    assert found.geometry.largest_difference(clean.geometry) < 1e-6
    assert found.records == clean.records == 54
    assert found.chi2 == pytest.approx(clean.chi2, rel=1e-6)
    assert found.dof == clean.dof


def test_several_bad_records_are_all_named(noisy, spoil, make_problem):
    bad = {(1, 4): 0.4, (2, 2): -0.5, (3, 8): 1.0, (5, 5): 0.2}
    for label, error in bad.items():
        noisy = spoil(noisy, label, deviation=(0.0, error, 0.0))
    found = identify(make_problem(noisy))
    assert named(found) == set(bad)
    assert found.records == 55 - len(bad)


def test_a_scatter_of_twice_the_noise_is_no_outlier(noisy, spoil, make_problem):
    found = identify(make_problem(spoil(noisy, (3, 7), deviation=(0.02, 0.0, 0.0))))
    assert found.data_faults == ()


def test_no_more_than_a_tenth_is_ever_left_out(noisy, spoil, make_problem):
    """Where so many disagree, it is unknown which are right; the chi-square is too large."""
    random = np.random.default_rng(0)
    for point in range(1, 6):
        for orientation in range(2, 6):
            error = random.uniform(-0.15, 0.15, 3)
            noisy = spoil(noisy, (point, orientation), deviation=error)
    found = identify(make_problem(noisy))
    assert len(found.left_out) <= 6
    assert found.records >= 49
    assert found.chi2 > 3 * found.dof


def test_nothing_is_left_out_without_screening(noisy, spoil, make_problem):
    spoilt = make_problem(spoil(noisy, (3, 7), deviation=(0.0, 0.0, 0.5)))
    found = identify(spoilt, find_outliers=False)
    assert found.data_faults == ()
    assert found.records == 55
    assert found.chi2 > 500


def changed(measurements, change, *, point=None, first=1):
    """Readings d (3,) replaced by ``change(d)``, at one point or at all, from one orientation on."""
    return altered(
        measurements,
        lambda r: {"deviation": change(np.array(r.deviation))},
        lambda r: point in {None, r.point} and r.orientation >= first,
    )


def test_all_records_after_a_shift_of_the_zero_are_left_out(noisy, make_problem):
    shifted = changed(noisy, lambda d: np.add(d, [0.0, 0.4, 0.0]), point=2, first=5)
    found = identify(make_problem(shifted))
    (fault,) = found.data_faults
    assert fault.kind is DataFaultKind.ZERO_SHIFT
    assert fault.gauges == "y"
    assert fault.sentence.startswith("Point 2: the zero of gauge y slipped before orientation 5 (y +0.4")
    assert fault.left_out == tuple((2, orientation) for orientation in range(5, 12))
    clean = identify(make_problem(without(noisy, *fault.left_out)))
    assert found.geometry.largest_difference(clean.geometry) < 1e-6


def test_two_shifts_of_the_zero_are_found_one_after_the_other(noisy, make_problem):
    shifted = changed(noisy, lambda d: np.add(d, [0.0, 0.4, 0.0]), point=2, first=5)
    shifted = changed(shifted, lambda d: np.add(d, [1.0, 0.0, 0.0]), point=4, first=7)
    faults = identify(make_problem(shifted)).data_faults
    assert {(fault.kind, fault.left_out[0]) for fault in faults} == {
        (DataFaultKind.ZERO_SHIFT, (2, 5)),
        (DataFaultKind.ZERO_SHIFT, (4, 7)),
    }


def test_a_shift_that_leaves_too_few_records_is_refused(visit, make_problem):
    few = visit(points=2, orientations=10, seed=80).measured(0.01, seed=81)
    shifted = changed(few, lambda d: np.add(d, [0.0, 1.5, 0.5]), point=1, first=3)
    with pytest.raises(GaugeFaultError, match="give only 30 equations") as raised:
        identify(make_problem(shifted))
    assert raised.value.fault.kind is DataFaultKind.ZERO_SHIFT
    assert raised.value.fault.left_out == ()


@pytest.mark.parametrize(
    ("change", "point", "kind", "gauges"),
    [
        (lambda d: d * [1.0, 1.0, -1.0], 2, DataFaultKind.REVERSED, "z"),
        (lambda d: -d, None, DataFaultKind.REVERSED, "xyz"),
        (lambda d: d[[1, 0, 2]], None, DataFaultKind.EXCHANGED, "xy"),
        (lambda d: d[[2, 0, 1]], 3, DataFaultKind.EXCHANGED, "xyz"),
        (lambda d: d / [1.0, 25.4, 1.0], 1, DataFaultKind.INCHES, "y"),
        (lambda d: d / 25.4, None, DataFaultKind.INCHES, "xyz"),
    ],
)
def test_a_gauge_fault_is_refused_and_named(visit, make_problem, change, point, kind, gauges):
    """Of more records than those for which a fit from other starts is tried first, which takes long."""
    many = visit(points=6, seed=2).measured(0.01, seed=1)
    with pytest.raises(GaugeFaultError) as raised:
        identify(make_problem(changed(many, change, point=point)))
    fault = raised.value.fault
    assert (fault.kind, fault.gauges) == (kind, gauges)
    assert ("at every point:" if point is None else f"at point {point}:") in fault.sentence
    assert fault.left_out == ()
    assert str(raised.value) == f"{fault.sentence}. {fault.action}"


@pytest.mark.parametrize(
    ("factors", "says", "gauges"),
    [
        ([1e3, 1e3, 1e3], "gauges x, y, z seem to read in micrometres: most readings exceed", "xyz"),
        ([1.0, 1e3, 1.0], "gauge y seems to read in micrometres", "y"),
        ([1e-3, 1e-3, 1e-3], "gauges x, y, z seem to read in metres: as millimetres they are", "xyz"),
        ([1.0, 1.0, 1e-3], "gauge z seems to read in metres", "z"),
    ],
)
def test_another_unit_is_recognised_before_anything_else(visit, make_problem, factors, says, gauges):
    records = visit(degrees=4.0, seed=2).measured(0.01, seed=1)
    problem = make_problem(changed(records, lambda d: d * factors))
    with pytest.raises(GaugeFaultError, match=says) as raised:
        identify(replace(problem, travel_mm=(12.5, 12.5, 12.5)))
    assert (raised.value.fault.kind, raised.value.fault.gauges) == (DataFaultKind.UNIT, gauges)


def test_small_deviations_of_a_good_machine_are_no_metres(visit, make_problem):
    """Their noise would be a thousand times as large."""
    random = np.random.default_rng(5)
    records = visit(degrees=4.0, seed=2).measured(0.01, seed=1)
    quiet = changed(records, lambda _: random.normal(0.0, 3e-3, 3))
    assert wrong_unit(make_problem(quiet)) is None


def test_a_gauge_fault_in_few_records_is_refused_too(noisy, make_problem):
    with pytest.raises(GaugeFaultError, match="gauge z seems to read in inches at point 3"):
        identify(make_problem(changed(noisy, lambda d: d / [1.0, 1.0, 25.4], point=3)))


@pytest.mark.parametrize(
    ("change", "kind", "gauges"),
    [
        (lambda d: d[[1, 0, 2]], DataFaultKind.EXCHANGED, "xy"),
        (lambda d: d * [1.0, 1.0, -1.0], DataFaultKind.REVERSED, "z"),
    ],
)
def test_a_gauge_fault_of_one_record_leaves_only_that_out(noisy, make_problem, change, kind, gauges):
    wrong = noisy.records[17].id
    spoilt = altered(noisy, lambda r: {"deviation": change(np.array(r.deviation))}, lambda r: r.id == wrong)
    (fault,) = identify(make_problem(spoilt)).data_faults
    assert (fault.kind, fault.gauges) == (kind, gauges)
    assert fault.left_out == (wrong,)


def test_joint_variables_of_another_pose_are_recognized(noisy, make_problem):
    records = list(noisy.records)
    first, second = records[16], records[17]
    records[16], records[17] = replace(first, joints=second.joints), replace(second, joints=first.joints)
    faults = identify(make_problem(MeasurementSet(tuple(records)))).data_faults
    assert [fault.kind for fault in faults] == [DataFaultKind.MISMATCHED_JOINTS] * 2
    assert [fault.left_out for fault in faults] == [(first.id,), (second.id,)]


def test_a_false_record_after_a_zero_shift_is_tested_as_one(noisy, make_problem) -> None:
    """It was left out for itself; records that only the shift concerns are not."""
    problem = make_problem(noisy)
    false = OutlierHypothesis(gain=100.0, unknowns=3, records=((2, 9),))
    shift = ZeroShiftHypothesis(
        gain=100.0, unknowns=3, point=2, orientation=4, shift=np.ones(3), significance=1.0
    )
    fit = CorrectedFit.uncorrected(problem).only_for((false, shift))
    assert [*fit.deletion_tests()] == [(2, 9)]
