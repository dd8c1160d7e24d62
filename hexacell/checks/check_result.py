"""The result of a check: the error of the controller's geometry now, what has changed, and the verdict."""

from collections.abc import Iterator
from datetime import datetime

import numpy as np

from hexacell.campaign.online_estimate import OnlineEstimate
from hexacell.cell.fields import Frozen
from hexacell.checks.change_alarm import ChangeAlarm, change_alarm
from hexacell.checks.check import Check
from hexacell.identification.diagnostics.tolerance_check import SIGNIFICANT_SIGMAS
from hexacell.measurements.records import MeasurementSet, RecordId
from hexacell.results.result import AcceptedResult
from hexacell.uncertainty.effects import Effect
from hexacell.verdict.decision import Verdict, VerifiedAccuracy
from hexacell.verdict.verification import outcome_of


class ParameterChange(Frozen):
    """How far a free parameter is from the controller's, and one standard deviation of that."""

    name: str
    unit: str
    change: float
    sigma: float

    @property
    def significance(self) -> float:
        """The change in standard deviations."""
        return abs(self.change) / self.sigma


class CheckResult(Frozen):
    """What a check says of the robot as it is now.

    Attributes:
        accuracy: errors of the controller's geometry; None where the robot can take no task pose.
        is_consistent: whether the residuals agree with the stated noise, however far the robot drifted.
        further_records: about how many more would decide; None where no number would, or nothing is open.
        earlier_run, earlier_at: the accepted result that it started from; None where that is the drawing.
        drift_scale: how many times as large as stated the drift since then is.
        left_out: records that the others prove false.
        alarm: the test of a change by the first records; None where the robot was not identified before, or
            where there were fewer.
    """

    verdict: Verdict
    records: int
    points: int
    accuracy: VerifiedAccuracy | None = None
    is_consistent: bool = True
    further_records: int | None = None
    earlier_run: str | None = None
    earlier_at: datetime | None = None
    drift_scale: float | None = None
    changes: tuple[ParameterChange, ...] = ()
    left_out: tuple[RecordId, ...] = ()
    alarm: ChangeAlarm | None = None

    @property
    def significant_change(self) -> ParameterChange | None:
        """The most significant change; None where all may be chance."""
        most = max(self.changes, key=lambda one: one.significance, default=None)
        return most if most is not None and most.significance >= SIGNIFICANT_SIGMAS else None


def check_result(
    check: Check, measurements: MeasurementSet, earlier: AcceptedResult | None, effects: tuple[Effect, ...]
) -> CheckResult:
    """The result of a check that has ended.

    ``earlier`` is what it started from; ``effects`` are the systematic ones.

    Raises:
        IdentifiabilityError: the records do not belong to this robot.
    """
    stated = check.final_statement(measurements, effects) if len(measurements) else None
    records, points = len(measurements), len(set(measurements.points.tolist()))
    if stated is None:
        return CheckResult(verdict=Verdict.NOT_EVALUATED, records=records, points=points)
    return CheckResult(
        verdict=stated.verdict,
        records=records,
        points=points,
        accuracy=VerifiedAccuracy.of(
            stated.errors,
            check.settings,
            check.robot,
            check.plan.task.reachable(stated.estimate.belief),
            is_evident=stated.is_consistent,
            length=None if earlier is None else earlier.length,
        ),
        is_consistent=stated.is_consistent,
        further_records=stated.further_records,
        earlier_run=earlier and earlier.run,
        earlier_at=earlier and earlier.at,
        drift_scale=stated.drift_scale,
        changes=tuple(_changes(stated.estimate)),
        left_out=tuple(sorted(check.false_records(measurements))),
        alarm=change_alarm(check, measurements, () if earlier is None else earlier.leg_temperatures_c),
    )


def check_line(result: CheckResult) -> str:
    """The outcome of a check in one line: what was measured, the error, the verdict and its reason."""
    measured = f"{result.records} records at {result.points} points"
    return outcome_of([f"check: {measured}"], result.accuracy, result.verdict, _reason(result))


def _reason(result: CheckResult) -> str:
    if result.verdict is not Verdict.NOT_EVALUATED:
        return ""
    if result.accuracy is None:
        return "the robot can take none of the task poses"
    if not result.is_consistent:
        return "the residuals are larger than the stated noise explains"
    if result.further_records is None:
        return "further records would not decide"
    return f"about {result.further_records} more records would decide"


def _changes(estimate: OnlineEstimate) -> Iterator[ParameterChange]:
    belief = estimate.belief
    convention = belief.mechanism.convention
    change = belief.free - convention.free_parameters(belief.controller)
    sigma = np.sqrt(np.diag(belief.covariance))
    for row, moved, deviation in zip(convention.free_rows, change.tolist(), sigma.tolist(), strict=True):
        parameter = belief.mechanism.parameters.parameters[row]
        yield ParameterChange(
            name=parameter.name, unit=parameter.kind.unit.value, change=moved, sigma=deviation
        )
