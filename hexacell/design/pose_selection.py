"""Selection of the pose to measure next: greedy optimal design under limits of travel and motion.

Candidates that linear propagation puts inside the gauges' travel are scored first, by the gain of a
criterion (:mod:`hexacell.design.criteria`) in a second of the time that the record takes: what counts is
the machine's time, and poses near by cost less of it. The best of them are refined
(:mod:`hexacell.design.candidate_refinement`). Their ranking is then walked from the best downward, a few
candidates at a time, and the first is taken that

1. the controller can be commanded to,
2. satisfies the chance constraint on the travel
   (:mod:`hexacell.design.travel_monte_carlo`),
3. can be reached by a path along which the constraint holds as well.

Of the few examined together a straight path is preferred to one over waypoints, which takes more moves,
unless the gain makes up for them; a path over the reference is the last choice.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.design.candidate_refinement import THOROUGH, CandidateSpace, Rounds
from hexacell.design.candidates import ReachableTargets, commands_for, outcomes_of
from hexacell.design.criteria import D_OPTIMAL, Criterion
from hexacell.design.predicted_records import GaugeZero, PredictedRecords, predict_records
from hexacell.design.travel_monte_carlo import TravelConstraint
from hexacell.errors import LimitError
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.motion.paths import Path, PathPlanner, Rows

MOST_CANDIDATES = 280
COMMAND_BATCHES = (12, 24, 48)
PATH_BATCH = 4
"""The best candidates are examined, their commands in batches, of the last size in the end, and their paths
in smaller ones: one of the first few is usually taken."""

UNCERTAIN_BATCH = 8
"""So many are tried together on many sampled robots: one of the first holds, or most fail early."""

WAYPOINT_GAIN_RATIO = 1.2
"""How much more a candidate must gain to be reached over waypoints, which take more moves."""


@dataclass(frozen=True, slots=True, eq=False)
class SelectedPose:
    """The selected pose.

    Attributes:
        command: what to send to the controller as it is configured now.
        record: the record (1) that it will give.
        gain: information gained on the parameters, nat.
        waypoints: commands to pass on the path; none on a straight line.
    """

    command: Pose
    record: PredictedRecords
    gain: float
    waypoints: tuple[Pose, ...]


def select_pose(
    planner: PathPlanner,
    zero: GaugeZero,
    orientations: Array,
    criterion: Criterion = D_OPTIMAL,
    known_then: Array | None = None,
    rounds: Rounds = THOROUGH,
    seconds_to: Callable[[ReachableTargets], Array] | None = None,
) -> SelectedPose:
    """The best by a criterion of some orientations (n, 3, 3), relative to the platform's at the reference.

    What gains most in the ``seconds_to`` (n,) go there and read is the best; without them, what gains most.

    They are not relative to the level platform: with millimetres of error in the joints the platform may
    be 20 degrees from where the controller believes it to be. A record has to gain beside what is
    ``known_then`` of parameters and terms, a covariance (p + 6 m, p + 6 m); None for the current one.

    Raises:
        LimitError: none is reachable within the limits and almost surely inside the travel.
    """
    belief = planner.belief
    covariance = belief.joint_covariance if known_then is None else known_then

    def rate(some: PredictedRecords) -> Array:
        gains = criterion.gain(covariance, some.jacobian, some.covariance)
        return gains if seconds_to is None else gains / seconds_to(some.targets)

    space = CandidateSpace(belief, zero, rate)
    if (candidates := space.rated(orientations @ zero.orientation)) is None:
        raise LimitError("no orientation is within reach, joint range, tilt limit and singularity margin")
    if len(candidates):
        candidates = space.refined(candidates, rounds)[:MOST_CANDIDATES]
    search = _PathSearch(TravelConstraint(belief, zero), planner)
    for ranked in _batches(np.arange(len(candidates)), *COMMAND_BATCHES):
        commands, found = commands_for(belief, candidates.records.targets[ranked])
        found &= belief.refused.allow(commands, belief.limits.frames, to_measure=True)
        rows = ranked[found]
        if selected := search.first_safe(candidates.records[rows], commands[found], candidates.gains[rows]):
            return selected
    raise LimitError("no orientation surely keeps the ball inside the gauges' travel")


def select_from_list(
    planner: PathPlanner, zero: GaugeZero, commands: PoseBatch, skipped: int
) -> SelectedPose:
    """The first of some commands (n) that almost surely stays inside the travel.

    The list's order takes the place of the gain. The first ``skipped`` of those inside the travel are left
    out.

    Raises:
        LimitError: none of them does.
    """
    belief = planner.belief
    commands = commands[belief.refused.allow(commands, belief.limits.frames, to_measure=True)]
    targets, rows = outcomes_of(belief, commands)
    records = predict_records(belief, zero, targets)
    inside = np.flatnonzero(records.within(belief.limits))[skipped:]
    search = _PathSearch(TravelConstraint(belief, zero), planner)
    selected = search.first_of_few(records[inside], commands[rows[inside]], np.full(len(inside), np.inf))
    if selected is None:
        raise LimitError(
            "none of the poses left in the list surely keeps the ball inside the gauges' travel"
        )
    return selected


@dataclass(frozen=True, slots=True, eq=False)
class _PathSearch:
    """Search for candidates that can be reached safely, all from one command."""

    travel: TravelConstraint
    planner: PathPlanner

    def first_safe(
        self, records: PredictedRecords, commands: PoseBatch, gains: Array
    ) -> SelectedPose | None:
        """The first of some ranked candidates with a safe path to it; a few are examined together."""
        rows = np.arange(len(records))
        for some in _batches(rows, UNCERTAIN_BATCH if self.travel.is_uncertain else PATH_BATCH):
            holds = self.travel.holds(records[some])
            for few in _batches(some, PATH_BATCH):
                hold = holds[few - some[0]]
                if selected := self.first_of_few(records[few], commands[few], gains[few], hold):
                    return selected
        return None

    def first_of_few(
        self, records: PredictedRecords, commands: PoseBatch, gains: Array, holds: Mask | None = None
    ) -> SelectedPose | None:
        """The best of a few ranked candidates: straight paths first, those over the reference last.

        ``holds`` says at which of them the constraint on the travel holds, if that is known.
        """
        rows = np.flatnonzero(self.travel.holds(records) if holds is None else holds)
        if not len(rows):
            return None
        paths = self.planner.options(commands)
        worth_waypoints, straight = rows, self._first(paths.straight, rows)
        if straight is not None:
            better = rows[rows < straight[0]]
            worth_waypoints = better[gains[better] >= WAYPOINT_GAIN_RATIO * gains[straight[0]]]
        over_waypoints = self._first(paths.via_waypoints, worth_waypoints)
        found = over_waypoints or straight or self._first(paths.via_reference, rows)
        if found is None:
            return None
        row, path = found
        record = records[np.array([row])]
        gain = D_OPTIMAL.gain(self.planner.belief.joint_covariance, record.jacobian, record.covariance)
        return SelectedPose(commands.pose(row), record, float(gain[0]), path.waypoints)

    def _first(self, paths_to: Callable[[Rows], list[Path | None]], rows: Rows) -> tuple[int, Path] | None:
        """The first row with a path along which the ball stays inside, and the path."""
        for row, path in zip(rows.tolist(), paths_to(rows), strict=True):
            if path is not None and self.travel.holds_along(path):
                return row, path
        return None


def _batches(rows: Rows, *sizes: int) -> Iterator[Rows]:
    """Batches of some sizes, and then of the last of them."""
    first, waiting = 0, list(sizes)
    while first < len(rows):
        size = waiting.pop(0) if len(waiting) > 1 else waiting[0]
        yield rows[first : first + size]
        first += size
