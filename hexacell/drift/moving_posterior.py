"""What is known of a robot some legs of which may move steadily, from all its runs so far.

After a change nobody knows how a leg moved, nor whether it stands still again. All that was known of it is
forgotten then, and its parameters have rates v from there on, which the runs tell: the state t days later
is ``x + t D v``, with the changes D of the state by the parameters. What continues as it did is expected
then, so that it is no further change, and what is not known of a leg is not taken for known of another.
Rates that are known to be small again are none: while they are unknown, steps are seen less well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.drift.carried_posterior import CarriedPosterior
from hexacell.drift.causes import Causes
from hexacell.drift.run_evidence import RunEvidence
from hexacell.kinematics.rotations import Array

USUAL_RATE = 0.01
"""Standard deviation of the rate of a parameter that may move, mm or rad a day."""

STILL_AGAIN = 100.0
"""How many times likelier the runs are if a leg stands still, so that it does."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingPosterior:
    """The posterior of s numbers of the state as they are on a day, then of r rates.

    Attributes:
        day: of the state.
        moving: (r) indices of the causes that have a rate.
    """

    causes: Causes
    day: float
    moving: tuple[int, ...]
    posterior: CarriedPosterior

    @classmethod
    def of_unmoved(cls, causes: Causes, day: float) -> MovingPosterior:
        """Nothing known, and nothing moves."""
        shared = causes.by_state.shape[1] - causes.free
        return cls(causes, day, (), CarriedPosterior.diffuse(causes.free, shared))

    @property
    def by_state(self) -> Array:
        """(m, s + r) change of the state and the rates by one unit of each cause."""
        return np.pad(self.causes.by_state, ((0, 0), (0, len(self.moving))))

    def seen(self, run: RunEvidence, day: float) -> RunEvidence:
        """The evidence of a run on a later day, on this state and the rates."""
        return run.in_terms_of(np.hstack([np.eye(len(run.weighted)), self._motion(day)]))

    def after(self, run: RunEvidence, day: float) -> MovingPosterior:
        """With one more run."""
        return replace(self, posterior=self.posterior.after(self.seen(run, day)))

    def on(self, day: float) -> MovingPosterior:
        """The same with the state as it is on a later day."""
        states, rates = self.causes.by_state.shape[1], len(self.moving)
        back = np.eye(states + rates)
        back[:states, states:] = -self._motion(day)
        return replace(self, day=day, posterior=CarriedPosterior(self.posterior.evidence.in_terms_of(back)))

    def forgetting_legs(self, legs: tuple[int, ...]) -> MovingPosterior:
        """The same when one of these legs may have moved in any way now, and may move on."""
        unmoved = self.without_rates(legs)
        known = unmoved.posterior
        moved = [index for index, leg in enumerate(self.causes.legs) if leg in legs]
        for index in moved:
            known = known.forgetting(unmoved.by_state[index])
        extended = known.with_unknowns(np.full(len(moved), USUAL_RATE))
        return replace(self, moving=(*unmoved.moving, *moved), posterior=extended)

    @property
    def still_legs(self) -> tuple[int, ...]:
        """Those that may move and most probably do not."""
        if not self.moving:
            return ()
        states, legs = self.causes.by_state.shape[1], self.causes.legs[list(self.moving)]
        rates = self.posterior.state[states:]
        covariance = np.linalg.inv(self.posterior.evidence.information)[states:, states:]
        return tuple(
            leg
            for leg in np.unique(legs).tolist()
            if _evidence_of_motion(rates[legs == leg], covariance[np.ix_(legs == leg, legs == leg)])
            < -np.log(STILL_AGAIN)
        )

    def standing_still(self, legs: tuple[int, ...]) -> MovingPosterior:
        """The same if some legs have not moved at all since they were forgotten."""
        rows, moving = self._left_by(legs)
        evidence = self.posterior.evidence
        left = RunEvidence(evidence.information[np.ix_(rows, rows)], evidence.weighted[rows])
        return replace(self, moving=moving, posterior=CarriedPosterior(left))

    def without_rates(self, legs: tuple[int, ...]) -> MovingPosterior:
        """The same with nothing said of the rates of some legs."""
        rows, moving = self._left_by(legs)
        return replace(self, moving=moving, posterior=self.posterior.marginal(rows))

    def _left_by(self, legs: tuple[int, ...]) -> tuple[list[int], tuple[int, ...]]:
        """The rows of the state and of the rates of other legs, and the causes of these."""
        states = self.causes.by_state.shape[1]
        kept = [place for place, index in enumerate(self.moving) if self.causes.legs[index] not in legs]
        rows = [*range(states), *(states + place for place in kept)]
        return rows, tuple(self.moving[place] for place in kept)

    def _motion(self, day: float) -> Array:
        """(s, r) change of the state until a day by one unit of each rate."""
        moved: Array = (day - self.day) * self.causes.by_state[list(self.moving)].T
        return moved


def _evidence_of_motion(rates: Array, covariance: Array) -> float:
    """Logarithm of how many times likelier the runs are if one parameter of a leg moves than if none.

    For one parameter that is the density of its rate of 0 before the runs over that after them (Dickey,
    The weighted likelihood ratio, Annals of Mathematical Statistics 42, 1971, 204-223).
    """
    information = np.linalg.inv(covariance)
    precision = np.diag(information)
    of_each = 0.5 * ((information @ rates) ** 2 / precision - np.log(USUAL_RATE**2 * precision))
    return float(np.logaddexp.reduce(of_each) - np.log(len(rates)))
