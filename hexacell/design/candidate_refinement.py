"""Refinement of candidates: the best of a sample are turned to where a record gains more.

The poses of a thousand orientations lie some ten degrees apart, and five of six are beyond a limit: late
in a campaign the best one gains a tenth to a fifth less than the best pose there is. Therefore the best of
them, none near another, are turned at random by smaller and smaller angles, fewer of them in each round. Of
those and what they were turned to the best go on, so that no gain is lost (a random local search with
successive halving; Spall, Introduction to Stochastic Search and Optimization, 2003).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from hexacell.design.candidates import rows_apart, targets_within_limits
from hexacell.design.predicted_records import GaugeZero, PredictedRecords, predict_clear_records
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics import rotations
from hexacell.kinematics.pose import Batch, PoseBatch
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True)
class Round:
    """One round: some candidates are ``refined``, by ``turns`` of up to ``angle``, rad, about each axis."""

    refined: int
    turns: int
    angle: float

    @lru_cache  # noqa: B019 - there are eight of them
    def random_turns(self) -> Array:
        """(refined, turns, 3, 3); the same ones every time: choices can be repeated."""
        shape = (self.refined, self.turns, 3)
        return rotations.from_vector(np.random.default_rng(0).uniform(-self.angle, self.angle, shape))


Rounds = tuple[Round, ...]

QUICK = (
    Round(10, 12, float(np.radians(8.0))),
    Round(4, 12, float(np.radians(3.5))),
    Round(3, 12, float(np.radians(1.5))),
)
"""The rounds that need fewest poses for their gain, of those compared with sixteen random robots."""

THOROUGH = (
    Round(16, 16, float(np.radians(10.0))),
    Round(10, 16, float(np.radians(5.0))),
    Round(6, 16, float(np.radians(3.0))),
    Round(5, 16, float(np.radians(1.5))),
    Round(4, 16, float(np.radians(0.8))),
)
"""These take a quarter more time of a whole decision, and gain nearly all that can be gained."""

KEPT = 40
KEPT_APART = float(np.radians(3.0))
"""So many of all come into the selection, so far from one another: the same paths lead to poses alike."""

APART = float(np.radians(6.0))
"""Candidates that are turned are at least so far from one another, rad, or as far as they were turned."""


@dataclass(frozen=True, slots=True, eq=False)
class RatedRecords(Batch):
    """Predicted records (n), and what each gains (n,)."""

    records: PredictedRecords
    gains: Array


@dataclass(frozen=True, eq=False)
class CandidateSpace:
    """The records that a point's poses could have: within the limits, and almost surely inside the travel.

    By linear propagation; what that does not see is checked before a pose is selected. ``gain`` gives what
    each of n records gains (n,).
    """

    belief: RobotBelief
    zero: GaugeZero
    gain: Callable[[PredictedRecords], Array]

    def rated(self, orientations: Array) -> RatedRecords | None:
        """The possible records of some orientations (n, 3, 3); None if the robot can take none of them."""
        belief, zero = self.belief, self.zero
        targets = targets_within_limits(belief, PoseBatch.at(zero.reference, orientations))
        records, clear = predict_clear_records(belief, zero, targets, self._mode)
        if not clear.any():
            return None
        records = records[clear & records.within(belief.limits)]
        return RatedRecords(records, self.gain(records))

    def refined(self, candidates: RatedRecords, rounds: Rounds) -> RatedRecords:
        """Some candidates, and the best of what their best ones were turned to, the best first."""
        parts, apart = [candidates], APART
        orientations, gains = candidates.records.targets.poses.rotations, candidates.gains
        for each in rounds:
            ranking = np.argsort(-gains, kind="stable")
            best = rows_apart(orientations, ranking, each.refined, apart)
            orientations, gains, apart = orientations[best], gains[best], min(APART, each.angle)
            turns = each.random_turns()[: len(orientations)] @ orientations[:, None]
            turned = self.rated(turns.reshape(-1, 3, 3))
            if turned is not None:
                parts.append(turned)
                orientations = np.concatenate([orientations, turned.records.targets.poses.rotations])
                gains = np.concatenate([gains, turned.gains])
        rated = RatedRecords.joined(parts)
        ranking = np.argsort(-rated.gains, kind="stable")
        is_kept = np.arange(len(rated)) < len(candidates)
        is_kept[rows_apart(rated.records.targets.poses.rotations, ranking, KEPT, KEPT_APART)] = True
        return rated[ranking[is_kept[ranking]]]

    @cached_property
    def _mode(self) -> Array:
        """The assembly mode (1,) that the estimated robot is on."""
        return self.zero.mode(self.belief)
