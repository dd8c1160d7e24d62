"""What proves a data fault: that the rest of the records, without it, agrees with the stated noise.

A machine whose model leaves something out has residuals with longer tails than the noise, and the worst of
them looks like a gross error. It is one only if the others are what the noise makes them. The less they
are, the further beyond its critical value the statistic of a fault must be:

- the rest agrees well without a single fault: 1.3 times;
- the rest agrees, or agrees well without several faults, of which the most significant counts: 4 times;
- the rest disagrees: 10 times, by the scatter that the records really have. No imperfect machine does that.

The agreement of the rest is evidence only with equations to spare (:func:`is_overdetermined`). What is not
proven stays in the fit, and no cause is named.

The factors separate the worlds of ``tests/benchmarks/worlds``: the largest statistic of an imperfect
machine is 4.1 critical values, and that of a reading off by 0.5 mm in a good one at least 4.8.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from hexacell.identification.data_faults.fault_model import CorrectedFit, FaultHypothesis
from hexacell.identification.data_faults.hypotheses import OutlierHypothesis, ZeroShiftHypothesis
from hexacell.identification.data_faults.record_test import DeletionTest
from hexacell.identification.problem.data_requirements import is_overdetermined
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.result import DataFaultKind
from hexacell.measurements.records import RecordId

GOOD_AGREEMENT = 0.05
"""Probability of the residuals of the rest from which they agree well."""

BESIDE_GOOD, BESIDE_AGREEING, BESIDE_DISAGREEING = 1.3, 4.0, 10.0


def required_significance(rest: ChiSquareTest, faults: int) -> float:
    """How many critical values the statistic of a fault must reach beside the rest of the records.

    The more ``faults`` are chosen, the less it proves that the rest agrees.
    """
    if rest.probability > GOOD_AGREEMENT and faults == 1:
        return BESIDE_GOOD
    return BESIDE_AGREEING if rest.is_explained else BESIDE_DISAGREEING


def proven_faults(
    selected: CorrectedFit, tests: Mapping[RecordId, DeletionTest]
) -> tuple[FaultHypothesis, ...]:
    """The faults of a fit that the rest of its records proves; ``tests`` are those of the left-out ones."""
    rest = selected.fit.goodness
    significances = _significances(selected, tests)
    required = required_significance(rest, len(significances))
    if rest.probability > GOOD_AGREEMENT and max(significances.values(), default=0.0) >= required:
        return selected.faults
    proven = {fault for fault, significance in significances.items() if significance >= required}
    parts = (_part(fault, proven) for fault in selected.faults)
    return tuple(part for part in parts if part is not None)


def _significances(
    selected: CorrectedFit, tests: Mapping[RecordId, DeletionTest]
) -> dict[RecordId | ZeroShiftHypothesis, float]:
    """That of each shift of the zero, and of each record with a gross error."""
    can_prove = is_overdetermined(selected.fit.problem)
    records = [
        record
        for fault in selected.faults
        if isinstance(fault, OutlierHypothesis)
        for record in fault.records
    ]
    return {
        **{
            fault: fault.significance for fault in selected.faults if isinstance(fault, ZeroShiftHypothesis)
        },
        **{record: _of_record(tests[record], can_prove) for record in records},
    }


def _of_record(test: DeletionTest, can_prove: bool) -> float:
    """Joint variables that do not belong to the command are false, whatever the fit says."""
    if test.statistics is None or test.fault.kind is DataFaultKind.MISMATCHED_JOINTS:
        return float("inf")
    return test.significance if can_prove else 0.0


def _part(
    fault: FaultHypothesis, proven: Collection[RecordId | ZeroShiftHypothesis]
) -> FaultHypothesis | None:
    """A fault, or of gross errors those that are proven; none if it is not proven."""
    if isinstance(fault, OutlierHypothesis):
        kept = [record for record in fault.records if record in proven]
        return fault.of(kept) if kept else None
    return fault if not isinstance(fault, ZeroShiftHypothesis) or fault in proven else None
