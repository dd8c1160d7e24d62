"""Data faults for people: what is wrong, how that shows, and what to do about it."""

import numpy as np

from hexacell.identification.data_faults import hypotheses
from hexacell.identification.data_faults.corrected_fit import CorrectedFit
from hexacell.identification.data_faults.deletion_tests import DeletionTest
from hexacell.identification.data_faults.stepwise_selection import Selection, UncorrectableFaultError
from hexacell.identification.solver.result import GAUGES, DataFault, DataFaultKind
from hexacell.lengths import shown
from hexacell.measurements.records import Deviation, RecordId

NAMED_SHARE = 0.3
"""Share of the largest component of a zero shift below which a gauge is not named."""

GAUGE_FAULT_WORDS = {
    DataFaultKind.INCHES: (
        "seems to read in inches",
        "seem to read in inches",
        f"if these readings are multiplied by {hypotheses.MM_PER_INCH}",
        f"Switch to millimetres and measure again, or multiply {{columns}} by {hypotheses.MM_PER_INCH}",
    ),
    DataFaultKind.REVERSED: (
        "looks reversed",
        "look reversed",
        "with the sign of these readings changed",
        "Correct the counting direction and measure again, or change the sign of {columns}",
    ),
    DataFaultKind.EXCHANGED: (
        "look exchanged",
        "look exchanged",
        "with these readings exchanged",
        "Check which gauge is on which channel and measure again, or put {columns} in the right order",
    ),
}
"""How a fault of one gauge looks, and of several, what corrects it, and what to do."""


def left_out(selection: Selection) -> tuple[DataFault, ...]:
    """What is wrong with the records that a fit does without."""
    shifts = []
    for shift, records in selection.selected.zero_shifts.items():
        consequence = f"; orientations {shift.orientation} to {records[-1][1]} are left out"
        shifts.append(_zero_shift(shift, consequence, tuple(records)))
    return (*map(_rejected_record, selection.tests.values()), *shifts)


def refused(error: UncorrectableFaultError) -> DataFault:
    """A fault for which the data are refused."""
    match error.fault:
        case hypotheses.ZeroShiftHypothesis() as shift:
            found = error.left.equations
            consequence = f", and the records before it and at the other points give only {found} equations"
            return _zero_shift(shift, consequence)
        case hypotheses.GaugeFaultHypothesis():
            return _gauge_faults(error.before, error.after)
    raise TypeError(error.fault)


def _rejected_record(test: DeletionTest) -> DataFault:
    point, orientation = test.record
    action = "Measure it again"
    if test.kind is DataFaultKind.MISMATCHED_JOINTS and test.leg:
        leg, off = test.leg
        fact = (
            f"q{leg} is {shown(off, '+')} off its place for the commanded pose, unlike in the point's "
            "other records; the record is left out"
        )
        action = "Check whether its joint variables belong to another pose, or measure it again"
    elif test.offset_mm is None:
        fact = "the pose is too near a singularity for this record to be used"
        action = "Choose another orientation"
    else:
        fact = f"{_wrong_readings(test.kind, test.gauges, test.offset_mm)}; the record is left out"
    return DataFault(
        test.kind,
        f"Point {point}, orientation {orientation}: {fact}",
        action,
        gauges=test.gauges,
        left_out=(test.record,),
        offset_mm=test.offset_mm,
    )


def _gauge_faults(before: CorrectedFit, after: CorrectedFit) -> DataFault:
    """The residuals before and after the correction of all that was found are the evidence."""
    found = [one for one in after.faults if isinstance(one, hypotheses.GaugeFaultHypothesis)]
    looks, corrections, actions = zip(*map(_gauge_fault_words, found), strict=True)
    without, rest = "", ""
    if before.lost:
        without = f" without {before.lost} record{'s' if before.lost > 1 else ''} that no geometry explains"
    if others := len(after.faults) - len(found):
        rest = f" and without records that {others} other fault{'s' if others > 1 else ''} spoilt"
    rest += "" if after.is_consistent else "; what is left has another cause"
    sentence = (
        f"{' and '.join(looks)}: the residuals are {before.fit.goodness.ratio:.3g} times the stated "
        f"noise{without}, and {after.fit.goodness.ratio:.3g} times {' and '.join(corrections)}{rest}"
    )
    gauges = "".join(one for one in GAUGES if any(one in fault.gauge_fault.gauges for fault in found))
    return DataFault(found[0].gauge_fault.kind, sentence, ". ".join(actions), gauges=gauges)


def _gauge_fault_words(hypothesis: hypotheses.GaugeFaultHypothesis) -> tuple[str, str, str]:
    """How a gauge fault looks, what corrects it, and what to do."""
    fault = hypothesis.gauge_fault
    where = "at every point" if hypothesis.point is None else f"at point {hypothesis.point}"
    columns = " and ".join(f"d{gauge}" for gauge in fault.gauges)
    *looks, correction, action = GAUGE_FAULT_WORDS[fault.kind]
    look = f"{_names(fault.gauges)} {looks[len(fault.gauges) > 1]} {where}"
    return look, correction, action.format(columns=f"{columns} {where}")


def _wrong_readings(kind: DataFaultKind, gauges: str, offset_mm: Deviation) -> str:
    match kind:
        case DataFaultKind.EXCHANGED:
            return f"{_names(gauges)} read exchanged"
        case DataFaultKind.REVERSED:
            return f"{_names(gauges)} read reversed"
        case DataFaultKind.INCHES:
            return f"{_names(gauges)} read in inches"
    if gauges:
        offset = offset_mm[GAUGES.index(gauges)]
        return f"gauge {gauges} is {shown(offset, '+')} off what all other records predict"
    x, y, z = (shown(one, "+") for one in offset_mm)
    return (
        f"the gauges are x {x}, y {y}, z {z} off what all other records predict: "
        "more than one of them is wrong, or an encoder"
    )


def _zero_shift(
    shift: hypotheses.ZeroShiftHypothesis, consequence: str, left_out: tuple[RecordId, ...] = ()
) -> DataFault:
    size = np.abs(shift.shift)
    shifted = [axis for axis in range(3) if size[axis] >= NAMED_SHARE * size.max()]
    gauges = "".join(GAUGES[axis] for axis in shifted)
    components = ", ".join(f"{GAUGES[axis]} {shift.shift[axis]:+.3f}" for axis in shifted)
    return DataFault(
        DataFaultKind.ZERO_SHIFT,
        f"Point {shift.point}: the zero of {_names(gauges)} slipped before orientation "
        f"{shift.orientation} ({components} mm){consequence}",
        f"Check that {_names(gauges)} and the station are clamped, and measure point {shift.point} again",
        gauges=gauges,
        left_out=left_out,
    )


def _names(gauges: str) -> str:
    if len(gauges) == 1:
        return f"gauge {gauges}"
    return f"gauges {', '.join(gauges[:-1])} and {gauges[-1]}"
