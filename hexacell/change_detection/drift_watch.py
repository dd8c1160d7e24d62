"""The watch over a series of runs: cumulative sums of the innovations, and where a step was if one alarms.

The sums are limited so that all of them together raise one false alarm in ten years of nights. After an
alarm the step is located; what was known of its cause is forgotten from then on, and the sums begin anew.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from hexacell.change_detection.carried_posterior import CarriedPosterior
from hexacell.change_detection.cumulative_sums import REFERENCE, CumulativeSums
from hexacell.change_detection.leg_evidence import possible_legs
from hexacell.change_detection.run_evidence import RunEvidence
from hexacell.change_detection.run_length import limit_for_run_length
from hexacell.change_detection.step_location import StepGains, step_gains
from hexacell.kinematics.rotations import Array

QUIET_RUNS = 3650.0
"""Between two false alarms of an unchanged robot: ten years of nights."""

OTHER_LEG_GAIN = 20.0
"""Of twice the log-likelihood, above which another leg changed as well: 4.5 standard deviations."""


@dataclass(frozen=True, slots=True, eq=False)
class Causes:
    """Single causes of a change.

    Attributes:
        by_state: (m, s) change of the state by one unit of each.
        legs: (m,) the leg of each, from 1.
        free: how many numbers of the state are free parameters; the others are shared causes.
    """

    by_state: Array
    legs: NDArray[np.int_]
    free: int


@dataclass(frozen=True, slots=True)
class StepAlarm:
    """A change that the sums found.

    Attributes:
        run: index of the run that alarmed.
        first, last: indices of the runs before the first and the last of which the step may have been.
        possible_legs: of which one changed, the likeliest first; only one where that is certain.
        cause: index of its likeliest cause.
        change, sigma: of that, in its unit.
        other_legs: that changed as well, within the runs since.
    """

    run: int
    first: int
    last: int
    possible_legs: tuple[int, ...]
    cause: int
    change: float
    sigma: float
    other_legs: tuple[int, ...]

    @property
    def leg(self) -> int:
        """The likeliest one."""
        return self.possible_legs[0]


@dataclass(frozen=True, slots=True, eq=False)
class WatchResult:
    """What the watch found, and its sums (m,) in the end, as shares of the limit.

    ``unchanged_from`` is the index of the first run after the last step, ``before`` what was known before.
    """

    alarms: tuple[StepAlarm, ...]
    share_of_limit: Array
    unchanged_from: int
    before: CarriedPosterior


@cache
def alarm_limit(streams: int) -> float:
    """The limit of the sums of so many streams."""
    return limit_for_run_length(QUIET_RUNS, REFERENCE, streams)


class DriftWatch:
    """Takes the runs of a robot one after the other.

    Attributes:
        before: what is known before the first run after the last step.
    """

    def __init__(self, causes: Causes) -> None:
        self._causes = causes
        shared = causes.by_state.shape[1] - causes.free
        self.before = CarriedPosterior.diffuse(causes.free, shared)
        self._posterior = self.before
        self._since: list[RunEvidence] = []
        self._sums = CumulativeSums.at_rest(len(causes.legs))
        self._runs = 0

    def add(self, run: RunEvidence) -> StepAlarm | None:
        """Take one more run; the alarm that it raises, if any."""
        self._sums = self._sums.after(self._posterior.scores(run, self._causes.by_state))
        self._posterior = self._posterior.after(run)
        self._since.append(run)
        self._runs += 1
        is_alarm = self._sums.largest.max() > alarm_limit(len(self._causes.legs))
        return self._located() if is_alarm else None

    @property
    def share_of_limit(self) -> Array:
        """The sums (m,) as shares of their limit."""
        shares: Array = self._sums.largest / alarm_limit(len(self._causes.legs))
        return shares

    @property
    def unchanged_from(self) -> int:
        """Index of the first run after the last step."""
        return self._runs - len(self._since)

    def _located(self) -> StepAlarm:
        """Where the step was; the watch goes on from there."""
        gains = step_gains(self.before, self._since, self._causes.by_state)
        place, legs, cause = self._likeliest(gains)
        first, last = gains.likely_runs(cause)
        offset = self.unchanged_from
        self._begin_anew(place, cause)
        return StepAlarm(
            run=self._runs - 1,
            first=offset + first,
            last=offset + last,
            possible_legs=legs,
            cause=cause,
            change=float(gains.changes[place, cause]),
            sigma=float(gains.sigmas[place, cause]),
            other_legs=self._other_legs(legs),
        )

    def _likeliest(self, gains: StepGains) -> tuple[int, tuple[int, ...], int]:
        """The run, the possible legs, and the cause of the likeliest of them."""
        legs, place = self._causes.legs, gains.likeliest[0]
        possible = possible_legs(np.sqrt(gains.gains[place]), gains.sigmas[place], legs)
        of_leg = np.where(legs == possible[0], gains.gains, -1.0)
        at, cause = np.unravel_index(of_leg.argmax(), of_leg.shape)
        return int(at), possible, int(cause)

    def _begin_anew(self, place: int, cause: int) -> None:
        before = self.before
        for run in self._since[:place]:
            before = before.after(run)
        self.before = before.forgetting(self._causes.by_state[cause])
        self._since = self._since[place:]
        self._posterior = self.before
        for run in self._since:
            self._posterior = self._posterior.after(run)
        self._sums = CumulativeSums.at_rest(len(self._causes.legs))

    def _other_legs(self, possible: tuple[int, ...]) -> tuple[int, ...]:
        """Those for which there is evidence of a step beside the one that was found."""
        gains = step_gains(self.before, self._since, self._causes.by_state).gains.max(axis=0)
        others = self._causes.legs[gains > OTHER_LEG_GAIN]
        return tuple(sorted({int(one) for one in others} - set(possible)))


def watch_runs(runs: Iterable[RunEvidence], causes: Causes) -> WatchResult:
    """The alarms of a series of runs, oldest first."""
    watch = DriftWatch(causes)
    found = [alarm for run in runs if (alarm := watch.add(run)) is not None]
    return WatchResult(tuple(found), watch.share_of_limit, watch.unchanged_from, watch.before)
