"""Anomalies in words: what is wrong, how that shows, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hexacell.identification.data_faults.hypotheses import (
    MM_PER_INCH,
    GaugeFault,
    GaugeFaultHypothesis,
    Label,
    ZeroShiftHypothesis,
)
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import DataFault, DataFaultKind, Outlier

SLIPPED_SIGNIFICANTLY = 0.3
"""Of the largest component of a slip: a gauge that shows less of it is not named."""


def of_record(outlier: Outlier) -> DataFault:
    """A record that was left out."""
    where = f"Point {outlier.point}, orientation {outlier.orientation}"
    sentence, action = _about_record(outlier)
    return DataFault(
        outlier.kind, outlier.point, outlier.orientation, outlier.gauges, f"{where}: {sentence}", action
    )


def of_slip(slip: ZeroShiftHypothesis, labels: Sequence[Label]) -> DataFault:
    """A slip, with the records after it that were left out."""
    gauges, fact = _slip_in_words(slip)
    last = labels[-1][1]
    return DataFault(
        DataFaultKind.SLIPPED_ZERO,
        slip.point,
        slip.orientation,
        gauges,
        f"{fact}; orientations {slip.orientation} to {last} are left out",
        f"Check that {_names(gauges)} and the station are clamped, and measure point {slip.point} again",
    )


def of_slip_refused(slip: ZeroShiftHypothesis, equations: int) -> DataFault:
    """A slip after which too little is left."""
    gauges, fact = _slip_in_words(slip)
    return DataFault(
        DataFaultKind.SLIPPED_ZERO,
        slip.point,
        slip.orientation,
        gauges,
        f"{fact}, and the records before it and at the other points give {equations} equations only",
        f"Check that {_names(gauges)} and the station are clamped, and measure point {slip.point} again",
    )


def of_misreading(suspect: GaugeFaultHypothesis, before: ChiSquareTest, after: ChiSquareTest) -> DataFault:
    """Misread gauges, refused."""
    misreading = suspect.misreading
    where = "at every point" if suspect.point is None else f"at point {suspect.point}"
    proof = (
        f"the residuals are {_times(before)} times the stated noise, and {_times(after)} times "
        f"{_were_it_undone(misreading)}"
    )
    return DataFault(
        misreading.kind,
        suspect.point,
        None,
        misreading.gauges,
        f"{_names(misreading.gauges)} {_look(misreading)} {where}: {proof}",
        _remedy(misreading, where),
    )


def _about_record(outlier: Outlier) -> tuple[str, str]:
    if outlier.kind is DataFaultKind.FOREIGN_JOINTS and outlier.stray:
        leg, off = outlier.stray
        return (
            f"q{leg} is {off:+.3f} mm from where the commanded pose puts it, unlike in the point's other "
            "records; this one is left out"
        ), "Check whether its q1 to q6 belong to another pose, or measure it again"
    if outlier.off_mm is None:
        return "a singularity is too near for this record to be used", "Choose another orientation"
    return f"{_about_readings(outlier, outlier.off_mm)}; the record is left out", "Measure it again"


def _about_readings(outlier: Outlier, off_mm: tuple[float, float, float]) -> str:
    if outlier.kind is not DataFaultKind.GROSS_ERROR:
        words = {
            DataFaultKind.EXCHANGED: "exchanged",
            DataFaultKind.REVERSED: "reversed",
            DataFaultKind.INCHES: "in inches",
        }
        return f"{_names(outlier.gauges)} read {words[outlier.kind]}"
    if outlier.gauges:
        off = off_mm["xyz".index(outlier.gauges)]
        return f"gauge {outlier.gauges} shows {off:+.3f} mm more than all other records let expect"
    x, y, z = off_mm
    return (
        f"the gauges show x {x:+.3f}, y {y:+.3f}, z {z:+.3f} mm more than all other records let expect, "
        "so that more than one of them is wrong, or an encoder"
    )


def _slip_in_words(slip: ZeroShiftHypothesis) -> tuple[str, str]:
    size = np.abs(slip.shift)
    moved = [axis for axis in range(3) if size[axis] >= SLIPPED_SIGNIFICANTLY * size.max()]
    gauges = "".join("xyz"[axis] for axis in moved)
    shift = ", ".join(f"{'xyz'[axis]} {slip.shift[axis]:+.3f}" for axis in moved)
    return gauges, (
        f"Point {slip.point}: the zero of {_names(gauges)} slipped before orientation {slip.orientation} "
        f"({shift} mm)"
    )


def _names(gauges: str) -> str:
    if len(gauges) == 1:
        return f"gauge {gauges}"
    return f"gauges {', '.join(gauges[:-1])} and {gauges[-1]}"


def _times(goodness: ChiSquareTest) -> str:
    return f"{goodness.ratio:.3g}"


def _look(misreading: GaugeFault) -> str:
    plural = len(misreading.gauges) > 1
    match misreading.kind:
        case DataFaultKind.INCHES:
            return "seem to read in inches" if plural else "seems to read in inches"
        case DataFaultKind.REVERSED:
            return "look reversed" if plural else "looks reversed"
        case _:
            return "look exchanged"


def _were_it_undone(misreading: GaugeFault) -> str:
    match misreading.kind:
        case DataFaultKind.INCHES:
            return f"if these readings are multiplied by {MM_PER_INCH}"
        case DataFaultKind.REVERSED:
            return "with the sign of these readings changed"
        case _:
            return "with these readings exchanged"


def _remedy(misreading: GaugeFault, where: str) -> str:
    columns = " and ".join(f"d{gauge}" for gauge in misreading.gauges)
    match misreading.kind:
        case DataFaultKind.INCHES:
            return (
                f"Switch to millimetres and measure again, or multiply {columns} {where} by {MM_PER_INCH}"
            )
        case DataFaultKind.REVERSED:
            return (
                f"Correct the counting direction and measure again, or change the sign of {columns} {where}"
            )
        case _:
            return (
                "Check which gauge is on which channel and measure again, or put "
                f"{columns} {where} in the right order"
            )
