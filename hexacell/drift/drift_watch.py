"""The watch over a series of runs: cumulative sums of the innovations, and which leg changed if one alarms.

The one-sided sum ``C = max(0, C + z - k)`` of independent normal values z alarms when it exceeds h (Page,
Biometrika 41, 1954, 100). It is a Markov process; with its range in ``STATES`` cells of equal width, the
mean number of values until the alarm solves linear equations (Brook and Evans, An approach to the
probability distribution of CUSUM run length, Biometrika 59, 1972, 539-549). The two sides of a two-sided
sum never alarm together, so that the inverses of their run lengths add (Kemp, Journal of the Royal
Statistical Society B 23, 1961, 149-153). The limit is such that the sums of all parameters together raise
one false alarm in ten years of nights.

After an alarm the step is located, what was known of the legs that it may be of is forgotten from then on,
and the sums begin anew. A leg that moves on alarms again, by what it has moved since.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np

from hexacell.distributions import normal_probability
from hexacell.drift.run_evidence import CarriedPosterior, Causes, RunEvidence, StepGains, step_gains
from hexacell.drift.single_cause import possible_groups
from hexacell.kinematics.rotations import Array

QUIET_RUNS = 3650.0
"""Runs between two false alarms of an unchanged robot: ten years of nights."""

OTHER_LEG_GAIN = 20.0
"""Gain of twice the log-likelihood above which another leg changed too: 4.5 standard deviations."""

REFERENCE = 0.5
"""k, what is subtracted from each value: half the shift that is found soonest, in standard deviations."""

STATES = 250
HIGHEST = 20.0
"""Largest limit considered, in standard deviations of a value."""


def one_sided_run_length(limit: float, shift: float = 0.0) -> float:
    """The mean number of values, of mean ``shift``, until a sum from 0 exceeds ``limit``."""
    width = 2.0 * limit / (2 * STATES - 1)
    centres = width * np.arange(STATES)
    steps = centres[None, :] - centres[:, None] + REFERENCE - shift
    stays = normal_probability(steps + 0.5 * width) - normal_probability(steps - 0.5 * width)
    stays[:, 0] = normal_probability(steps[:, 0] + 0.5 * width)
    return float(np.linalg.solve(np.eye(STATES) - stays, np.ones(STATES))[0])


def two_sided_run_length(limit: float, shift: float = 0.0) -> float:
    """The mean number of values until one of the sums upwards and downwards exceeds ``limit``."""
    up, down = (one_sided_run_length(limit, one) for one in (shift, -shift))
    return 1.0 / (1.0 / up + 1.0 / down)


@cache
def alarm_limit(streams: int) -> float:
    """The limit h of two-sided sums over some streams, for one false alarm in ``QUIET_RUNS`` of them all.

    Streams may depend on each other: the rates of their alarms add all the same, or less.
    """

    def excess(limit: float) -> float:
        return float(np.log(two_sided_run_length(limit) / (streams * QUIET_RUNS)))

    from scipy.optimize import brentq  # noqa: PLC0415 - a fifth of a second that only a watch needs

    return float(brentq(excess, 0.1, HIGHEST, xtol=1e-6))


def sums_after(sums: Array, values: Array) -> Array:
    """The sums (2, m) of m streams, upwards and downwards, with one more value of each (m,).

    They begin at zero and are never negative. NaN where a stream has no value this time.
    """
    both = np.maximum(0.0, sums + np.stack([values, -values]) - REFERENCE)
    return np.where(np.isnan(values), sums, both)


@dataclass(frozen=True, slots=True)
class StepAlarm:
    """A change that the sums found.

    Attributes:
        run: index of the run that alarmed.
        first, last: indices of the runs before the first and the last of which the step may have been.
        possible_legs: legs of which one changed, the likeliest first; only one where that is certain.
        cause: index of the likeliest cause of the likeliest leg.
        change, sigma: estimate of the step by that cause, in its unit, and its standard deviation.
        or_causes: other causes of that leg that the runs do not tell from it, each with its change.
        other_legs: legs that changed as well.
    """

    run: int
    first: int
    last: int
    possible_legs: tuple[int, ...]
    cause: int
    change: float
    sigma: float
    or_causes: tuple[tuple[int, float], ...]
    other_legs: tuple[int, ...]

    @property
    def leg(self) -> int:
        """The likeliest one."""
        return self.possible_legs[0]


class DriftWatch:
    """Takes the runs of a robot in turn."""

    def __init__(self, causes: Causes) -> None:
        self._causes = causes
        self._runs: list[RunEvidence] = []
        self._known = CarriedPosterior.diffuse(causes.free, causes.by_state.shape[1] - causes.free)
        self._periods = [(0, self._known)]  # first run after each change, and what was known before it
        self._noticed: list[tuple[int, int, int, set[int]]] = []  # run, first, last, other legs of each
        self._sums: Array = np.zeros((2, len(causes.legs)))

    def add(self, run: RunEvidence) -> bool:
        """Take one more run; whether it raises an alarm."""
        self._sums = sums_after(self._sums, self._known.scores(run, self._causes.by_state))
        self._known = self._known.after(run)
        self._runs.append(run)
        is_raised = bool(self._sums.max() > alarm_limit(len(self._causes.legs)))
        if is_raised:
            self._locate()
        return is_raised

    @property
    def share_of_limit(self) -> Array:
        """The sums (m,) as shares of their limit."""
        return np.asarray(self._sums.max(axis=0) / alarm_limit(len(self._causes.legs)))

    def _alarm(self, change: int) -> StepAlarm:
        """An alarm with the legs and the size by the runs from the change before it to the one after it."""
        (begin, before), (place, _) = self._periods[change : change + 2]
        later = self._periods[change + 2 :]
        end = max(later[0][0], place + 1) if later else len(self._runs)
        gains, row = step_gains(before, self._runs[begin:end], self._causes.by_state), place - begin
        legs, (cause, *others_of_leg) = self._likeliest(gains, row)
        run, first, last, others = self._noticed[change]
        size, sigma = float(gains.changes[row, cause]), float(gains.sigmas[row, cause])
        or_causes = tuple((one, float(gains.changes[row, one])) for one in others_of_leg)
        moved = tuple(sorted(others - {*legs}))
        return StepAlarm(run, first, last, legs, cause, size, sigma, or_causes, moved)

    @property
    def alarms(self) -> tuple[StepAlarm, ...]:
        """All so far, oldest first."""
        return tuple(map(self._alarm, range(len(self._noticed))))

    def _locate(self) -> None:
        """Find the step before one of the latest runs; the watch goes on from there."""
        offset, before = self._periods[-1]
        gains = self._gains()
        legs, _ = self._likeliest(gains, int(gains.gains.max(axis=1).argmax()))
        of_leg = np.where(self._causes.legs == legs[0], gains.gains, -1.0)
        place, cause = (int(one) for one in np.unravel_index(of_leg.argmax(), of_leg.shape))
        start = offset + place
        forgotten = self._causes.by_state[np.isin(self._causes.legs, legs)]
        known = before.after(*self._runs[offset:start]).forgetting(forgotten)
        self._periods.append((start, known))
        self._known = known.after(*self._runs[start:])
        self._sums = np.zeros_like(self._sums)
        moved = self._causes.legs[self._gains().gains.max(axis=0) > OTHER_LEG_GAIN]
        first, last = (offset + row for row in gains.likely_runs(cause))
        self._noticed.append((len(self._runs) - 1, first, last, set(moved.tolist()) - {*legs}))

    def _gains(self) -> StepGains:
        """The gains of steps since the last change."""
        first, before = self._periods[-1]
        return step_gains(before, self._runs[first:], self._causes.by_state)

    def _likeliest(self, gains: StepGains, place: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The possible legs of a step at a place, and the possible causes of the likeliest leg."""
        scores, sigmas = np.sqrt(gains.gains[place]), gains.sigmas[place]
        legs = possible_groups(scores, sigmas, self._causes.legs)
        of_leg = np.flatnonzero(self._causes.legs == legs[0])
        return legs, possible_groups(scores[of_leg], sigmas[of_leg], of_leg)


def watch_runs(runs: Iterable[RunEvidence], causes: Causes) -> tuple[tuple[StepAlarm, ...], Array]:
    """The changes, oldest first, each by all runs until the next one, and :attr:`.share_of_limit` then."""
    watch = DriftWatch(causes)
    for run in runs:
        watch.add(run)
    return watch.alarms, watch.share_of_limit
