"""Deviations in micrometres or metres, recognised before anything else is taken for a fault.

No gauge shows more than its travel, whatever the robot does: where most readings of a gauge exceed it, and
would not as micrometres, they are micrometres. Readings in metres are smaller than their own noise, which
nothing but another unit explains if they agree with the encoders once they are multiplied by 1000: a
machine that hardly deviates has noise, which would be a thousand times as large. Inches are a gauge fault
among others: they differ from millimetres by so little that fits have to be compared.
"""

import numpy as np

from hexacell.identification.data_faults.hypotheses import GaugeFault, GaugeFaultHypothesis
from hexacell.identification.data_faults.stepwise_selection import CorrectedFit
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.result import GAUGES, DataFault, DataFaultKind
from hexacell.kinematics.rotations import Mask

MM_PER_METRE = 1000.0

SURE_SIGMAS = 10.0
"""Readings in metres are so many times larger than their noise, or agree with anything."""


def wrong_unit(problem: Problem) -> DataFault | None:
    """That gauges read in micrometres or metres; None if they do not."""
    # A point's reference deviates from itself by nothing.
    readings = np.delete(problem.deviations @ problem.gauges, problem.first_rows, axis=0)
    if not len(readings):
        return None
    usual = np.median(np.abs(readings), axis=0)
    travel = np.asarray(problem.travel_mm)
    if (beyond := (usual > travel) & (usual / MM_PER_METRE < travel)).any():
        evidence = (
            f"most readings exceed the travel of {travel[beyond].max():g} mm, and the largest is "
            f"{np.abs(readings[:, beyond]).max():.4g}"
        )
        return _fault(beyond, "micrometres", evidence, "divide")
    noise = problem.noise.gauges_mm
    size = np.sqrt(np.mean(readings**2, axis=0))
    small = (size < noise) & (MM_PER_METRE * size > SURE_SIGMAS * noise)
    if not small.any():
        return None
    remedy = np.diag(np.where(small, MM_PER_METRE, 1.0))
    fault = GaugeFault(DataFaultKind.UNIT, _gauges(small), remedy)
    in_mm = GaugeFaultHypothesis(gain=0.0, unknowns=0, gauge_fault=fault, point=None)
    corrected = CorrectedFit.uncorrected(in_mm.corrected(problem))
    if not corrected.is_consistent or not problem.is_overdetermined:
        return None
    evidence = (
        f"as millimetres they are {1e3 * size[small].max():.3g} um and smaller than their noise, and "
        f"multiplied by {MM_PER_METRE:g} they agree with the encoders"
    )
    return _fault(small, "metres", evidence, "multiply")


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
