"""Deviations in micrometres or metres, recognised before anything else is taken for a fault.

No gauge shows more than its travel, whatever the robot does: where most readings of a gauge exceed it, and
would not as micrometres, they are micrometres. Readings in metres are smaller than their own noise, which
nothing but another unit explains if they agree with the encoders once they are multiplied by 1000: a
machine that hardly deviates has noise, which would be a thousand times as large. Inches are a gauge fault
among others: they differ from millimetres by so little that fits have to be compared.
"""

import numpy as np

from hexacell.identification.data_faults.corrected_fit import CorrectedFit
from hexacell.identification.data_faults.hypotheses import GaugeFault, GaugeFaultHypothesis
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.result import GAUGES, DataFault, DataFaultKind
from hexacell.kinematics.rotations import Mask
from hexacell.lengths import MM_PER_METRE

FAR_BEYOND = 10.0
"""Times the travel that nobody states too small by mistake."""

SURE_SIGMAS = 10.0
"""Readings in metres are so many times larger than their noise, or agree with anything."""


def wrong_unit(problem: Problem) -> DataFault | None:
    """That gauges read in micrometres or metres; None if they do not."""
    # A point's reference deviates from itself by nothing.
    readings = np.delete(problem.deviations @ problem.gauges, problem.first_rows, axis=0)
    if not len(readings):
        return None
    usual, travel = np.median(np.abs(readings), axis=0), np.asarray(problem.travel_mm)
    beyond = (usual > travel) & (usual / MM_PER_METRE < travel)
    # Gauges may have more travel than stated, but not so much more.
    is_far = (usual > FAR_BEYOND * travel)[beyond].all()
    as_um = 1.0 / MM_PER_METRE
    # The longer search, for a geometry that micrometres fit, only where millimetres fit none.
    if beyond.any() and (is_far or (not _agrees(problem, beyond, 1.0) and _agrees(problem, beyond, as_um))):
        evidence = (
            f"most readings exceed the travel of {travel[beyond].max():g} mm, and the largest is "
            f"{np.abs(readings[:, beyond]).max():.4g}"
        )
        return _fault(beyond, "micrometres", evidence, "divide")
    noise = problem.noise.gauges_mm
    size = np.sqrt(np.mean(readings**2, axis=0))
    small = (size < noise) & (MM_PER_METRE * size > SURE_SIGMAS * noise)
    if small.any() and _agrees(problem, small, MM_PER_METRE):
        evidence = (
            f"as millimetres they are {1e3 * size[small].max():.3g} um and smaller than their noise, and "
            f"multiplied by {MM_PER_METRE:g} they agree with the encoders"
        )
        return _fault(small, "metres", evidence, "multiply")
    return None


def _agrees(problem: Problem, gauges: Mask, factor: float) -> bool:
    """Whether all records agree with the noise once the readings of some gauges are multiplied."""
    fault = GaugeFault(DataFaultKind.UNIT, _gauges(gauges), np.diag(np.where(gauges, factor, 1.0)))
    in_mm = GaugeFaultHypothesis(gain=0.0, unknowns=0, gauge_fault=fault, point=None)
    return problem.is_overdetermined and CorrectedFit.uncorrected(in_mm.corrected(problem)).is_consistent


def _gauges(which: Mask) -> str:
    return "".join(np.array(list(GAUGES))[which])


def _fault(which: Mask, unit: str, evidence: str, remedy: str) -> DataFault:
    gauges = _gauges(which)
    columns = " and ".join(f"d{gauge}" for gauge in gauges)
    subject = f"gauge {gauges} seems" if len(gauges) == 1 else f"gauges {', '.join(gauges)} seem"
    return DataFault(
        DataFaultKind.UNIT,
        f"{subject} to read in {unit}: {evidence}",
        f"Switch to millimetres, or {remedy} {columns} by {MM_PER_METRE:g}",
        gauges=gauges,
    )
