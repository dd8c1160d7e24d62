"""Data faults for people: what is wrong, how that shows, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hexacell.identification.data_faults.gauge_faults import MM_PER_INCH, GaugeFault
from hexacell.identification.data_faults.hypotheses import GaugeFaultHypothesis, ZeroShiftHypothesis
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import GAUGES, DataFault, DataFaultKind
from hexacell.measurements.records import Deviation, RecordId

NAMED_SHARE = 0.3
"""Of the largest component of a zero shift: gauges with smaller components are not named."""


def rejected_record(
    record: RecordId,
    kind: DataFaultKind,
    *,
    gauges: str = "",
    offset_mm: Deviation | None = None,
    leg: tuple[int, float] | None = None,
) -> DataFault:
    """A record that is left out.

    ``gauges`` are the faulty gauges, empty if no single one is at fault. ``offset_mm`` are the errors of
    the gauges x, y and z; ``leg`` is a leg (from 1) and its distance from the commanded position, mm.
    """
    point, orientation = record
    if kind is DataFaultKind.MISMATCHED_JOINTS and leg:
        fact, action = _mismatched_joints(leg)
    elif offset_mm is None:
        fact, action = (
            "the pose is too near a singularity for this record to be used",
            "Choose another orientation",
        )
    else:
        fact = f"{_wrong_readings(kind, gauges, offset_mm)}; the record is left out"
        action = "Measure it again"
    return DataFault(
        kind,
        f"Point {point}, orientation {orientation}: {fact}",
        action,
        gauges=gauges,
        left_out=(record,),
        offset_mm=offset_mm,
    )


def zero_shift(shift: ZeroShiftHypothesis, left_out: Sequence[RecordId]) -> DataFault:
    """A shift of the gauges' zero, with the records after it that are left out."""
    _, last = left_out[-1]
    consequence = f"; orientations {shift.orientation} to {last} are left out"
    return _zero_shift(shift, consequence, tuple(left_out))


def refused_zero_shift(shift: ZeroShiftHypothesis, equations: int) -> DataFault:
    """A shift of the gauges' zero after which too few records are left."""
    consequence = f", and the records before it and at the other points give only {equations} equations"
    return _zero_shift(shift, consequence)


def gauge_fault(
    hypothesis: GaugeFaultHypothesis, before: ChiSquareTest, after: ChiSquareTest, *, lost: int = 0
) -> DataFault:
    """A gauge fault, refused; the residuals before and after its correction are the evidence.

    ``lost`` counts the records that had no place in the fit before, next to a singularity.
    """
    fault = hypothesis.gauge_fault
    where = "at every point" if hypothesis.point is None else f"at point {hypothesis.point}"
    looks, correction, action = _looks_correction_action(fault, where)
    sentence = (
        f"{_names(fault.gauges)} {looks} {where}: the residuals are {before.ratio:.3g} times the stated "
        f"noise{_without(lost)}, and {after.ratio:.3g} times {correction}"
    )
    return DataFault(fault.kind, sentence, action, gauges=fault.gauges)


def _without(lost: int) -> str:
    if not lost:
        return ""
    return f" without {lost} record{'s' if lost > 1 else ''} that no geometry explains"


def _mismatched_joints(leg: tuple[int, float]) -> tuple[str, str]:
    number, off = leg
    return (
        f"q{number} is {off:+.3f} mm off its place for the commanded pose, unlike in the point's other "
        "records; the record is left out"
    ), "Check whether q1 to q6 belong to another pose, or measure it again"


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
        return f"gauge {gauges} is {offset:+.3f} mm off what all other records predict"
    x, y, z = offset_mm
    return (
        f"the gauges are x {x:+.3f}, y {y:+.3f}, z {z:+.3f} mm off what all other records predict: "
        "more than one of them is wrong, or an encoder"
    )


def _zero_shift(
    shift: ZeroShiftHypothesis, consequence: str, left_out: tuple[RecordId, ...] = ()
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


def _looks_correction_action(fault: GaugeFault, where: str) -> tuple[str, str, str]:
    """How a gauge fault looks, what corrects it, and what to do."""
    plural = len(fault.gauges) > 1
    columns = " and ".join(f"d{gauge}" for gauge in fault.gauges)
    match fault.kind:
        case DataFaultKind.INCHES:
            look = "seem to read in inches" if plural else "seems to read in inches"
            correction = f"if these readings are multiplied by {MM_PER_INCH}"
            action = (
                f"Switch to millimetres and measure again, or multiply {columns} {where} by {MM_PER_INCH}"
            )
        case DataFaultKind.REVERSED:
            look = "look reversed" if plural else "looks reversed"
            correction = "with the sign of these readings changed"
            action = (
                f"Correct the counting direction and measure again, or change the sign of {columns} {where}"
            )
        case _:
            look = "look exchanged"
            correction = "with these readings exchanged"
            action = (
                "Check which gauge is on which channel and measure again, or put "
                f"{columns} {where} in the right order"
            )
    return look, correction, action
