"""The statement of a check: the robot's errors at the task poses, and the verdict on them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.online_estimate import OnlineEstimate
from hexacell.campaign.task_accuracy import Task
from hexacell.cell.measuring import ErrorLimits
from hexacell.design.criteria import add_information
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import Effect
from hexacell.uncertainty.statement import TaskErrors, covariance_factor
from hexacell.verdict.decision import Verdict, decide_both

MOST_FURTHER_RECORDS = 200
"""A verdict that takes more is not forecast: repeatability and drift end what records can do before."""


@dataclass(frozen=True, slots=True)
class CheckStatement:
    """Errors of the robot and the verdict on them, by the records so far.

    Attributes:
        errors: of the controller's geometry at the task poses that the estimated robot reaches.
        drift_scale: the likeliest scale of the drift; None where the robot was not identified before.
        is_consistent: whether the residuals agree with the stated noise.
        further_records: about how many more would decide; None where no number would, or nothing is open.
    """

    estimate: OnlineEstimate
    errors: TaskErrors
    verdict: Verdict
    drift_scale: float | None
    is_consistent: bool
    records: int
    further_records: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ErrorEstimate:
    """The errors at t task poses by one estimate of the robot.

    Attributes:
        jacobian: (t, 6, p) of the errors by the free parameters.
        difference: (p,) of the estimate from the controller's geometry.
        covariance: of the estimate (p, p).
        systematic: (t, 6, k) effects that the covariance does not contain.
        known: (t, 6) errors by effects that were measured before.
    """

    jacobian: Array
    difference: Array
    covariance: Array
    systematic: Array
    known: Array

    @classmethod
    def of(
        cls,
        task: Task,
        estimate: OnlineEstimate,
        effects: Iterable[Effect] = (),
        earlier: Mapping[str, Array] | None = None,
    ) -> ErrorEstimate | None:
        """The errors by an estimate while measuring; None if the estimated robot reaches no task pose.

        ``effects`` are the systematic ones. Where the prior is an earlier estimate, ``earlier`` says what
        they did to that one (:attr:`~hexacell.uncertainty.budget.UncertaintyBudget.parameter_columns`).
        """
        belief = estimate.belief
        if (jacobian := task.jacobian(belief)) is None:
            return None
        commanding = belief.mechanism.convention.free_parameters(belief.controller)
        acting, found = [effect for effect in effects if effect.size], estimate.identification
        budget = task.budget(found, belief, acting, earlier) if found is not None and acting else None
        shape = jacobian.shape[:2]
        systematic = np.zeros((*shape, 0)) if budget is None else budget.not_in_covariance
        known = np.zeros(shape) if budget is None else budget.known
        return cls(jacobian, belief.free - commanding, belief.covariance, systematic, known)

    @property
    def errors(self) -> TaskErrors:
        """The errors with their uncertainty."""
        by_noise = self.jacobian @ covariance_factor(self.covariance)
        estimated = self.jacobian @ self.difference + self.known
        return TaskErrors(estimated, np.concatenate([by_noise, self.systematic], axis=-1))

    def after(self, information: Array) -> ErrorEstimate:
        """The errors after records that add information (p, p) and confirm the estimate."""
        return replace(self, covariance=add_information(self.covariance, information))


def guarded_verdict(likeliest: TaskErrors, guarded: TaskErrors, limits: ErrorLimits) -> Verdict:
    """The verdict by the likeliest errors; a pass holds for the guarded ones as well.

    These are already those of a robot that drifted more than it is likely to: of them a pass keeps U alone.
    """
    verdict = decide_both(likeliest.position, likeliest.orientation, limits)
    with_u_alone = limits.model_copy(update={"guard_band_factor": 1.0})
    holds = decide_both(guarded.position, guarded.orientation, with_u_alone) is Verdict.PASS
    return verdict if holds or verdict is not Verdict.PASS else Verdict.CONDITIONAL_PASS


def records_to_decide(
    likeliest: ErrorEstimate, guarded: ErrorEstimate, limits: ErrorLimits, per_record: Array
) -> int | None:
    """How many more records would decide if they confirm the likeliest estimate.

    ``per_record`` (p, p), 1/mm^2, is the information of each.
    """
    confirmed = replace(guarded, difference=likeliest.difference)

    def is_decided(records: int) -> bool:
        likely, careful = (one.after(records * per_record).errors for one in (likeliest, confirmed))
        return guarded_verdict(likely, careful, limits).is_final

    if not is_decided(MOST_FURTHER_RECORDS):
        return None
    return 1 + bisect_left(range(1, MOST_FURTHER_RECORDS + 1), True, key=is_decided)
