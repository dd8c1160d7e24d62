"""The quick level: a check carried on until the robot is known as well as the last calibration left it.

It starts from the last accepted result and from what may have drifted since, as a check does
(:mod:`~hexacell.checks.check`), and chooses poses in the same way. It ends once the error predicted at
the worst task pose is that of the last calibration, or its budget is used. Its result is a whole geometry.
"""

from dataclasses import dataclass, replace
from functools import cached_property

from hexacell.campaign.planner import Plan
from hexacell.cell.fields import Frozen
from hexacell.checks.check import Check, DriftEstimator, ScaledEstimate, check_settings
from hexacell.design.criteria import add_information
from hexacell.identification.belief import RobotBelief
from hexacell.identification.problem.prior import IdentifiedBefore, Prior
from hexacell.lengths import shown
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot
from hexacell.verdict.check_statement import MOST_FURTHER_RECORDS

FURTHER_RECORDS = (12, 24, 48)
"""Numbers of further records whose gain is stated."""

AS_ACCURATE = 1.02
"""Largest error in multiples of what the last calibration left: nobody measures for two hundredths."""


class FurtherRecords(Frozen):
    """The predicted error at the worst task pose, 1 sigma, mm, that more records would leave."""

    records: int
    error_mm: float


class QuickAccuracy(Frozen):
    """How well the quick level knows the robot: predicted errors at the worst task pose, 1 sigma, mm.

    Attributes:
        error_mm: error by these records and what was known before.
        calibrated_mm: error that the result left which it started from.
        drift_scale: how many times as large as stated the drift since then is.
        records_to_calibrated: about how many more would leave as little as that result; 0 where these do,
            None where no sensible number would.
    """

    records: int
    error_mm: float
    calibrated_mm: float
    drift_scale: float
    further: tuple[FurtherRecords, ...] = ()
    records_to_calibrated: int | None = None

    @property
    def ratio(self) -> float:
        """The error, as a multiple of that of the result before."""
        return self.error_mm / self.calibrated_mm


@dataclass(frozen=True, eq=False)
class QuickLevel:
    """The quick level of one robot.

    Attributes:
        check: the check of the same robot, from the same result on; it has one.
        budget: largest number of records, references included.
    """

    check: Check
    budget: int

    @cached_property
    def plan(self) -> Plan:
        """What to measure, until the robot is known as well as before or the budget is used."""
        settings = check_settings(self.check.settings, self.budget)
        return replace(self.check.plan, settings=settings, goal=self)

    @cached_property
    def calibrated_mm(self) -> float | None:
        """The error predicted at the worst task pose that the result before left; None without poses."""
        return self._worst(replace(self.check.robot.belief(), covariance=self._before.covariance))

    @property
    def expected(self) -> Prior:
        """What is known of the robot before the first record, if it drifted as stated."""
        return self._before.prior(1.0)

    def reached(self, measurements: MeasurementSet) -> str | None:
        """The reason why the records are enough; None if they are not.

        They alone have to determine a geometry, and be tested.
        """
        if not len(measurements):
            return None
        estimate, wanted = self._drifting.likeliest(measurements).estimate, self.calibrated_mm
        found = estimate.identification
        if found is None or not found.problem.is_overdetermined:
            return None
        error = self._worst(estimate.belief)
        if error is None or wanted is None or error > AS_ACCURATE * wanted:
            return None
        return f"the predicted error at the task poses is {shown(error)}, that of the last calibration"

    def reached_at(self, _point: int, measurements: MeasurementSet) -> str | None:
        """The reason why a point needs no more records: that all together are enough."""
        return self.reached(measurements)

    def robot_after(self, measurements: MeasurementSet) -> Robot:
        """The robot with what was known before the records, under the drift's scale that they show."""
        scale = self._drifting.likeliest(measurements).scale if len(measurements) else 1.0
        robot, known = self.check.robot, self._before.prior(scale)
        # What the records leave as uncertain as the drawing is not determined, whatever was known before.
        known = replace(known, tolerance_sigma=robot.prior.sigma)
        return replace(robot, known=known)

    def accuracy(self, measurements: MeasurementSet) -> QuickAccuracy | None:
        """How well the robot is known; None if it can take no task pose."""
        likeliest, wanted = self._drifting.likeliest(measurements), self.calibrated_mm
        error = self._worst(likeliest.estimate.belief)
        if error is None or wanted is None:
            return None
        errors, enough = self._errors_after(likeliest), AS_ACCURATE * wanted
        return QuickAccuracy(
            records=len(measurements),
            error_mm=error,
            calibrated_mm=wanted,
            drift_scale=likeliest.scale,
            further=tuple(FurtherRecords(records=n, error_mm=errors[n]) for n in FURTHER_RECORDS),
            records_to_calibrated=next((n for n, mm in enumerate(errors) if mm <= enough), None),
        )

    def _errors_after(self, estimate: ScaledEstimate) -> list[float]:
        """The predicted error after 0, 1, 2, ... more records, as informative as well spread ones."""
        belief = estimate.estimate.belief
        error = self.plan.task.error(belief)
        assert error is not None  # noqa: S101 - there is an error now
        each = replace(self.plan, settings=self.check.settings).information_per_record(belief)
        return [
            error.worst(
                add_information(belief.covariance, records * each) if records else belief.covariance
            )
            for records in range(MOST_FURTHER_RECORDS + 1)
        ]

    def _worst(self, belief: RobotBelief) -> float | None:
        error = self.plan.task.error(belief)
        return None if error is None else error.worst(belief.covariance)

    @property
    def _drifting(self) -> DriftEstimator:
        assert self.check.drifting is not None  # noqa: S101 - without a result no quick level is begun
        return self.check.drifting

    @property
    def _before(self) -> IdentifiedBefore:
        assert self.check.before is not None  # noqa: S101 - likewise
        return self.check.before
