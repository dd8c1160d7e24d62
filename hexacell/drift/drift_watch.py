"""The watch over a series of runs: cumulative sums of the innovations, and where a step was if one alarms.

The sums are limited so that all of them together raise one false alarm in ten years of nights. After an
alarm the step is located, what was known of the legs that it may be of is forgotten from then on, and the
sums begin anew. Those legs may move on steadily: that is then expected, and no further alarm.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from hexacell.drift.causes import Causes
from hexacell.drift.change_attribution import AttributedChange, attributed_change
from hexacell.drift.cumulative_sums import REFERENCE, CumulativeSums
from hexacell.drift.leg_evidence import possible_legs
from hexacell.drift.moving_posterior import MovingPosterior
from hexacell.drift.run_evidence import RunEvidence
from hexacell.drift.run_length import limit_for_run_length
from hexacell.drift.step_location import StepGains, step_gains
from hexacell.kinematics.rotations import Array

QUIET_RUNS = 3650.0
"""Between two false alarms of an unchanged robot: ten years of nights."""

OTHER_LEG_GAIN = 20.0
"""Of twice the log-likelihood, above which another leg changed as well: 4.5 standard deviations."""


@dataclass(frozen=True, slots=True)
class StepAlarm:
    """A change that the sums found, by the runs until then.

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
class QuietPeriod:
    """The runs between two changes: index of the first, and what was known of the robot before it."""

    first: int
    before: MovingPosterior


@dataclass(frozen=True, slots=True, eq=False)
class WatchResult:
    """What the watch found.

    Attributes:
        alarms: oldest first.
        attributed: what each of these changes is of, by all runs until the one after it.
        share_of_limit: (m,) the sums in the end, as shares of the limit.
        since: the runs after the last change.
    """

    alarms: tuple[StepAlarm, ...]
    attributed: tuple[AttributedChange, ...]
    share_of_limit: Array
    since: QuietPeriod


@cache
def alarm_limit(streams: int) -> float:
    """The limit of the sums of so many streams."""
    return limit_for_run_length(QUIET_RUNS, REFERENCE, streams)


class DriftWatch:
    """Takes the runs of a robot one after the other.

    Attributes:
        alarms: so far.
    """

    def __init__(self, causes: Causes) -> None:
        self.alarms: list[StepAlarm] = []
        self._causes = causes
        self._periods = [QuietPeriod(0, MovingPosterior.of_unmoved(causes, 0.0))]
        self._known = self._periods[0].before
        self._runs: list[RunEvidence] = []
        self._days: list[float] = []
        self._sums = CumulativeSums.at_rest(len(causes.legs))

    def add(self, run: RunEvidence, day: float | None = None) -> StepAlarm | None:
        """Take one more run; the alarm that it raises, if any. Without a ``day``, runs are a day apart."""
        day = float(len(self._runs)) if day is None else day
        known = self._known
        self._sums = self._sums.after(known.posterior.scores(known.seen(run, day), known.by_state))
        self._known = known.after(run, day)
        self._runs.append(run)
        self._days.append(day)
        if self._sums.largest.max() <= alarm_limit(len(self._causes.legs)):
            self._settle()
            return None
        self.alarms.append(self._located())
        return self.alarms[-1]

    @property
    def share_of_limit(self) -> Array:
        """The sums (m,) as shares of their limit."""
        shares: Array = self._sums.largest / alarm_limit(len(self._causes.legs))
        return shares

    @property
    def since(self) -> QuietPeriod:
        """The runs after the last change."""
        return self._periods[-1]

    def attributed(self, change: int) -> AttributedChange:
        """What a change is of, by the runs since the one before it and until the one after it."""
        period, place = self._periods[change], self._periods[change + 1].first
        later = self._periods[change + 2 :]
        end = max(later[0].first, place + 1) if later else len(self._runs)
        rows = range(period.first, end)
        causes = Causes(period.before.by_state, self._causes.legs, self._causes.free)
        return attributed_change(
            period.before.posterior,
            self._seen(period, rows),
            np.array([self._days[row] for row in rows]),
            place - period.first,
            causes,
        )

    def _seen(self, period: QuietPeriod, rows: Iterable[int]) -> list[RunEvidence]:
        return [period.before.seen(self._runs[row], self._days[row]) for row in rows]

    def _gains(self) -> StepGains:
        """Of steps since the last change."""
        before, runs = self.since.before, self._seen(self.since, range(self.since.first, len(self._runs)))
        return step_gains(before.posterior, runs, before.by_state)

    def _located(self) -> StepAlarm:
        """Where the step was; the watch goes on from there."""
        gains, offset = self._gains(), self.since.first
        place, legs, cause = self._likeliest(gains)
        first, last = gains.likely_runs(cause)
        self._begin_anew(offset + place, legs)
        return StepAlarm(
            run=len(self._runs) - 1,
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

    def _begin_anew(self, first: int, legs: tuple[int, ...]) -> None:
        """From the first run after a step of one of some legs."""
        known = self.since.before
        for row in range(self.since.first, first):
            known = known.after(self._runs[row], self._days[row])
        known = known.on(self._days[first]).forgetting_legs(legs)
        self._periods.append(QuietPeriod(first, known))
        self._know_anew()
        self._sums = CumulativeSums.at_rest(len(self._causes.legs))

    def _settle(self) -> None:
        """Legs that most probably stand still again do."""
        if still := self._known.still_legs:
            since = self._periods.pop()
            self._periods.append(QuietPeriod(since.first, since.before.standing_still(still)))
            self._know_anew()

    def _know_anew(self) -> None:
        """From all runs since the last change."""
        self._known = self.since.before
        for row in range(self.since.first, len(self._runs)):
            self._known = self._known.after(self._runs[row], self._days[row])

    def _other_legs(self, possible: tuple[int, ...]) -> tuple[int, ...]:
        """Those for which there is evidence of a step beside the one that was found."""
        others = self._causes.legs[self._gains().gains.max(axis=0) > OTHER_LEG_GAIN]
        return tuple(sorted({int(one) for one in others} - set(possible)))


def watch_runs(
    runs: Iterable[RunEvidence], causes: Causes, days: Sequence[float] | None = None
) -> WatchResult:
    """The alarms of a series of runs, oldest first, on some ``days``; without them each a day later."""
    watch = DriftWatch(causes)
    for number, run in enumerate(runs):
        watch.add(run, None if days is None else days[number])
    attributed = tuple(watch.attributed(change) for change in range(len(watch.alarms)))
    return WatchResult(tuple(watch.alarms), attributed, watch.share_of_limit, watch.since)
