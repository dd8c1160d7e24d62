"""When a campaign ends, and when it leaves a point: budget, accuracy reached, another point worth more."""

from dataclasses import dataclass
from math import hypot
from typing import Protocol

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.forecast import Forecaster
from hexacell.campaign.online_estimate import RecordEstimator
from hexacell.campaign.pilots import are_counted
from hexacell.cell.model import CellSettings
from hexacell.lengths import shown
from hexacell.measurements.records import MeasurementSet
from hexacell.uncertainty.statement import COVERAGE_FACTOR

REFUSALS = 3
"""Number of records of one point that may leave the travel before the point is given up."""


class Goal(Protocol):
    """What a campaign is for, if it is not the accuracy of the identified geometry."""

    def reached(self, measurements: MeasurementSet) -> str | None:
        """The reason why the records are enough; None if they are not."""

    def reached_at(self, point: int, measurements: MeasurementSet, /) -> str | None:
        """The reason why a point needs no more records, although others may; None if it does."""


@dataclass(frozen=True, slots=True, eq=False)
class StoppingRules:
    """The rules of one plan, each of which gives the reason to stop, or None."""

    settings: CellSettings
    forecaster: Forecaster
    estimator: RecordEstimator
    goal: Goal | None = None

    def end_of_campaign(self, state: CampaignState) -> str | None:
        """Between points: why no other point is to be begun, whichever it is."""
        sizes = self.forecaster.sizes(state)
        if all(state.records_at(point) >= size for point, size in sizes.items()):
            return f"all {len(sizes)} points are measured"
        if reason := self._budget_used(state, points=1, records=2):
            return reason
        reached = self.goal.reached(state.measurements) if self.goal else self._target_reached(state)
        if reached is None and state.done.issuperset(sizes):
            return f"all {len(sizes)} points are measured as far as they could be"
        return reached

    def end_of_point(self, state: CampaignState, point: int) -> str | None:
        """At a point: why no more records are to be taken there, whichever they are."""
        size = self.forecaster.sizes(state)[point]
        if state.records_at(point) >= size:
            return f"all its {size} orientations are measured"
        if state.rejections > REFUSALS:
            return f"the ball left the gauges' travel {state.rejections} times"
        if reason := self._budget_used(state, points=0, records=1):
            return reason
        if self.goal is not None:
            return self.goal.reached_at(point, state.measurements)
        return self._target_reached(state) or self._another_point(state, point)

    def _budget_used(self, state: CampaignState, *, points: int, records: int) -> str | None:
        """Whether so many more points and records cannot be afforded, in words."""
        budget = self.forecaster.budget
        times = self.forecaster.times(state)
        left = budget.records_left(len(state.measurements), state.begun_points + points, times)
        return None if left >= records else f"the budget of {budget.description} is used"

    def _target_reached(self, state: CampaignState) -> str | None:
        """Whether the accuracy asked for is reached, in words."""
        target = self.settings.identification.target_mm
        if target is None or not len(state.measurements):
            return None
        estimate = self.estimator(state.steering)
        found = estimate.identification
        if found is None or not found.problem.subset(are_counted(found.problem)).is_determined:
            return None
        worst = self.forecaster.worst_error(state, estimate.belief)
        if worst is None:
            return None
        expanded = COVERAGE_FACTOR * hypot(worst, self.forecaster.systematic_mm() or 0.0)
        is_reached = expanded <= target
        return f"U at the task poses is {shown(expanded)}, within {target:g} mm" if is_reached else None

    def _another_point(self, state: CampaignState, point: int) -> str | None:
        """Whether another point is worth more, if points are to be chosen, in words."""
        sizes = self.forecaster.sizes(state)
        others = [other for other in sizes if other not in state.done and other != point]
        if not self.settings.identification.choose_points or not others:
            return None
        belief = self.estimator(state.steering).belief
        best = self.forecaster.best_point(state, belief, [point, *others])
        return None if best == point else f"point {best} gains more in the same time"
