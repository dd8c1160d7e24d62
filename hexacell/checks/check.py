"""A check: a short identification that decides whether the robot, as it is now, is within a limit.

It starts from what the last accepted result left known of the geometry, and from what may have drifted
since; without such a result from the drawing. Poses are chosen for the error at the task poses. The check
ends as soon as that error and its uncertainty decide against the limit, or its budget is used.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from hexacell.campaign.online_estimate import OnlineEstimate, OnlineEstimator, RecordEstimator
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import PoseList
from hexacell.cell.model import CellSettings
from hexacell.design.search_effort import USUAL_EFFORT, SearchEffort
from hexacell.identification.problem.prior import IdentifiedBefore, drift_covariance, drift_sigma
from hexacell.identification.solver.chi_square import ChiSquareVerdict
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.rotations import Array
from hexacell.lengths import unit_of
from hexacell.measurements.records import MeasurementSet, Record, RecordId
from hexacell.robot.model import Robot
from hexacell.uncertainty.effects import Effect
from hexacell.verdict.check_statement import (
    CheckStatement,
    ErrorEstimate,
    guarded_verdict,
    records_to_decide,
)
from hexacell.verdict.decision import Verdict

USUAL_SCALES = (1.0, 3.0, 10.0)
"""All as likely as each other before measuring."""

LARGE_SCALES = (30.0, 100.0)
"""Considered where the one below is the likeliest so far: a robot that was hit, or has another config."""

GUARDED_SCALE = 3.0
"""The least scale that poses are chosen for, and under which a robot must be within its limit to pass."""

FIRST_SCALE = 10.0
"""The least scale that the first poses are chosen for: they must keep the ball inside the travel."""

FIRST_RECORDS = 3


@dataclass(frozen=True, slots=True, eq=False)
class ScaledEstimate:
    """The estimate under one scale of the drift."""

    scale: float
    estimate: OnlineEstimate
    log_likelihood: float

    @classmethod
    def of(cls, scale: float, estimate: OnlineEstimate, records: int) -> "ScaledEstimate":
        """An estimate of so many records; one that leaves some of them out is the least likely."""
        if (found := estimate.identification) is None:
            return cls(scale, estimate, 0.0)
        is_whole = found.records == records
        return cls(scale, estimate, found.log_marginal_likelihood if is_whole else -np.inf)


class DriftEstimator:
    """Estimates one robot under each scale of its drift since it was identified.

    ``robot`` has what is known of it before the first record, under the guarded scale.
    """

    def __init__(self, robot: Robot, before: IdentifiedBefore) -> None:
        scales = USUAL_SCALES + LARGE_SCALES
        robots = {scale: replace(robot, known=before.prior(scale)) for scale in scales}
        self.robot = robots[GUARDED_SCALE]
        self._estimators = {
            scale: OnlineEstimator(one, tries_other_starts=False) for scale, one in robots.items()
        }

    def estimate(self, measurements: MeasurementSet) -> OnlineEstimate:
        """The estimate that poses are chosen by."""
        least = FIRST_SCALE if len(measurements) < FIRST_RECORDS else GUARDED_SCALE
        return self.at_least(least, measurements).estimate

    def likeliest(self, measurements: MeasurementSet) -> ScaledEstimate:
        """The estimate under the scale with the largest marginal likelihood, the smallest of equals."""
        return max(self._considered(measurements), key=lambda one: one.log_likelihood)

    def at_least(self, scale: float, measurements: MeasurementSet) -> ScaledEstimate:
        """The estimate under the likeliest scale, or under a ``scale`` of these that is larger."""
        likeliest = self.likeliest(measurements)
        return likeliest if likeliest.scale >= scale else self._at(scale, measurements)

    def _considered(self, measurements: MeasurementSet) -> Iterator[ScaledEstimate]:
        usual = [self._at(scale, measurements) for scale in USUAL_SCALES]
        yield from usual
        best = max(one.log_likelihood for one in usual)
        last = usual[-1]
        for scale in LARGE_SCALES:
            if len(measurements) == 0 or last.log_likelihood < best:
                return
            last = self._at(scale, measurements)
            best = max(best, last.log_likelihood)
            yield last

    def _at(self, scale: float, measurements: MeasurementSet) -> ScaledEstimate:
        return ScaledEstimate.of(scale, self._estimators[scale].estimate(measurements), len(measurements))


FEWEST_POINTS = 2
"""Points with more than the reference, at which a check measures whatever was known before."""


@dataclass(frozen=True, eq=False)
class Check:
    """The check of one robot against limits of the errors at its task poses.

    Its statements raise an ``IdentifiabilityError`` where the records do not belong to this robot.

    Attributes:
        before: the last accepted result, and its drift since; None without such a result.
        budget: largest number of records, references included.
        listed: poses to measure; None if they are chosen.
        effects: the systematic ones. A check shares the constant ones with the result before it, so that
            its records do not reduce them.
        earlier: what these did to that result, as errors (p, k) of its free parameters by effect.
    """

    settings: CellSettings
    robot: Robot
    before: IdentifiedBefore | None
    budget: int
    listed: PoseList | None = None
    effects: tuple[Effect, ...] = ()
    earlier: Mapping[str, Array] = field(default_factory=dict)
    effort: SearchEffort = USUAL_EFFORT
    _stated: dict[tuple[Record, ...], CheckStatement | None] = field(default_factory=dict, init=False)

    @cached_property
    def plan(self) -> Plan:
        """What to measure, until the check is decided or its budget is used."""
        drifting = self.drifting
        return Plan(
            check_settings(self.settings, self.budget),
            self.robot if drifting is None else drifting.robot,
            self.listed,
            self.effort,
            estimator=self._by_drawing if drifting is None else drifting.estimate,
            goal=self,
            earlier=self.earlier,
        )

    def reached(self, measurements: MeasurementSet) -> str | None:
        """The reason why the records are enough for the whole check; None if they are not."""
        _, records = np.unique(measurements.points, return_counts=True)
        is_enough = np.count_nonzero(records > 1) >= FEWEST_POINTS
        return self._decided(measurements) if is_enough else None

    def reached_at(self, point: int, measurements: MeasurementSet) -> str | None:
        """The reason why a point needs no more records, though others may; None if it does."""
        is_measured = np.count_nonzero(measurements.points == point) > 1
        return self._decided(measurements) if is_measured else None

    def statement(self, measurements: MeasurementSet) -> CheckStatement | None:
        """The statement by some records; None if the estimated robot can take no task pose."""
        records = measurements.records
        if records not in self._stated:
            self._stated.clear()  # only the last one is asked for again
            self._stated[records] = self._statement(measurements, self.effects)
        return self._stated[records]

    def final_statement(
        self, measurements: MeasurementSet, effects: tuple[Effect, ...]
    ) -> CheckStatement | None:
        """The statement at the end of the check, where what is not decided is not evaluated.

        ``effects`` are the systematic ones as they are known by then.
        """
        stated = self._statement(measurements, effects)
        if stated is None or stated.verdict.is_final:
            return stated
        likeliest, guarded = self._estimates(measurements)
        errors, further = (self._errors(likeliest, effects), self._errors(guarded, effects)), None
        if stated.is_consistent and errors[0] is not None and errors[1] is not None:
            # Each is as informative as those of well spread sets on average.
            whole = replace(self.plan, settings=self.settings)
            each = whole.information_per_record(likeliest.estimate.belief)
            further = records_to_decide(errors[0], errors[1], self.settings.acceptance, each)
        return replace(stated, verdict=Verdict.NOT_EVALUATED, further_records=further)

    def false_records(self, measurements: MeasurementSet) -> frozenset[RecordId]:
        """Records that the others prove false; no statement counts them."""
        return self._estimates(measurements)[0].estimate.false_records

    def _decided(self, measurements: MeasurementSet) -> str | None:
        stated = self.statement(measurements)
        if stated is None or not stated.verdict.is_final:
            return None
        error = stated.errors.position
        unit = unit_of(error.value, error.expanded)
        size = f"{unit.number(error.value)} +- {unit.length(error.expanded)}"
        return f"the error at the task poses is {size}: {stated.verdict}"

    def _statement(
        self, measurements: MeasurementSet, effects: tuple[Effect, ...]
    ) -> CheckStatement | None:
        likeliest, guarded = self._estimates(measurements)
        estimates = self._errors(likeliest, effects), self._errors(guarded, effects)
        if estimates[0] is None or estimates[1] is None:
            return None
        errors, found = estimates[0].errors, likeliest.estimate.identification
        # Whether the residuals are not too large for the stated noise.
        is_consistent = found is None or found.goodness.agreement is not ChiSquareVerdict.TOO_LARGE
        verdict = guarded_verdict(errors, estimates[1].errors, self.settings.acceptance)
        return CheckStatement(
            estimate=likeliest.estimate,
            errors=errors,
            verdict=verdict if is_consistent else Verdict.NOT_EVALUATED,
            drift_scale=None if self.before is None else likeliest.scale,
            is_consistent=is_consistent,
            records=len(measurements),
        )

    def _estimates(self, measurements: MeasurementSet) -> tuple[ScaledEstimate, ScaledEstimate]:
        """Under the likeliest scale of the drift, and under the guarded one; by the drawing the same."""
        if self.drifting is not None:
            guarded = self.drifting.at_least(GUARDED_SCALE, measurements)
            return self.drifting.likeliest(measurements), guarded
        estimate = ScaledEstimate(1.0, self._by_drawing(measurements), 0.0)
        return estimate, estimate

    def _errors(self, estimate: ScaledEstimate, effects: tuple[Effect, ...]) -> ErrorEstimate | None:
        return ErrorEstimate.of(self.plan.task, estimate.estimate, effects, self.earlier)

    @cached_property
    def drifting(self) -> DriftEstimator | None:
        """Estimates the robot from the result before on; None without one."""
        return None if self.before is None else DriftEstimator(self.robot, self.before)

    @cached_property
    def _by_drawing(self) -> RecordEstimator:
        return OnlineEstimator(self.robot).estimate


def check_settings(settings: CellSettings, budget: int) -> CellSettings:
    """A cell's settings with those of a check, of ``budget`` records, in the place of the calibration's."""
    plan = settings.identification
    points = len(plan.points) - len(settings.excluded_points)
    identification = plan.model_copy(
        update={
            "criterion": "task",
            "orientations": max(2, math.ceil(budget / points)),
            "budget_records": budget,
            "budget_minutes": None,
            "target_mm": None,
            "choose_points": False,
            "provisional": False,
        }
    )
    return settings.model_copy(update={"identification": identification})


def identified_before(
    robot: Robot, covariance: Array, drift_mm: float, identified: Geometry | None = None
) -> IdentifiedBefore:
    """The controller's geometry, as identified with a covariance (P, P), mm^2, of all parameters.

    ``drift_mm`` is the standard deviation of what each length may have changed since. Where the controller
    got another geometry than was identified, that is given in the mechanism's frame convention.
    """
    mechanism, geometry = robot.mechanism, robot.commanding if identified is None else identified
    rows = mechanism.convention.free_rows
    drift = drift_covariance(mechanism, geometry, drift_sigma(mechanism, drift_mm, robot.tolerances))
    return IdentifiedBefore(mechanism, geometry, covariance[np.ix_(rows, rows)], drift)
