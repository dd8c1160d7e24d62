"""Selection of the pose to measure next: greedy optimal design under limits of travel and motion.

Candidates are scored first, by the gain of a criterion (:mod:`hexacell.experiment_design.criteria`). Those
that linear propagation puts inside the gauges' travel are ranked by it. The ranking is then walked from
the best downward, a few candidates at a time, and the first is taken that

1. the controller can be commanded to,
2. satisfies the chance constraint on the travel
   (:mod:`hexacell.experiment_design.travel_monte_carlo`),
3. can be reached by a path along which the constraint holds as well.

Of the few examined together a straight path is preferred to one over waypoints, which takes more moves,
unless the gain makes up for them; a path over the reference is the last choice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.errors import LimitError
from hexacell.experiment_design.candidates import commands_for, outcomes_of, reachable_targets
from hexacell.experiment_design.criteria import D_OPTIMAL, Criterion
from hexacell.experiment_design.predicted_records import (
    TRAVEL_SHARE,
    GaugeZero,
    PredictedRecords,
    predict_records,
)
from hexacell.experiment_design.travel_monte_carlo import TravelConstraint
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.paths import Path, PathPlanner, Rows

MOST_CANDIDATES = 240
COMMAND_BATCH = 48
PATH_BATCH = 4
"""The best candidates are examined, their commands in batches and their paths in smaller ones: one of the
first few is usually taken."""

WAYPOINT_GAIN_RATIO = 1.2
"""How much more a candidate must gain to be reached over waypoints, which take more moves."""


@dataclass(frozen=True, slots=True, eq=False)
class SelectedPose:
    """The selected pose.

    Attributes:
        command: what to send to the controller as it is configured now.
        joints: joint variables (6,), mm, it will go to.
        deviation: what the gauges are expected to show (3,), mm.
        sigma: standard deviation (3,), mm, of ``deviation``.
        gain: information gained on the parameters, nat.
        jacobian: of the deviation (3, p) by the free parameters.
        covariance: of the deviation (3, 3), mm^2, the parameters being known.
        waypoints: commands to pass on the path; none on a straight line.
    """

    command: Pose
    joints: Array
    deviation: Array
    sigma: Array
    gain: float
    jacobian: Array
    covariance: Array
    waypoints: tuple[Pose, ...] = ()


def select_pose(
    belief: RobotBelief,
    zero: GaugeZero,
    orientations: Array,
    start: PoseBatch | None = None,
    criterion: Criterion = D_OPTIMAL,
    reference_command: PoseBatch | None = None,
) -> SelectedPose:
    """The best of some orientations (n, 3, 3), relative to the platform's at the zeroed reference.

    They are not relative to the level platform: with millimetres of error in the joints the platform may
    be 20 degrees from where the controller believes it to be.

    Args:
        belief: the estimate of the robot and its covariance.
        zero: of the point's gauges.
        orientations: the candidates.
        start: the command (1) that the path starts from; by default that of the reference.
        criterion: what is gained.
        reference_command: the command (1) of the reference, if paths may pass through it.

    Raises:
        LimitError: none is reachable within the limits and almost surely inside the travel.
    """
    poses = PoseBatch.at(zero.reference, orientations @ zero.orientation)
    records = predict_records(belief, zero, reachable_targets(belief, poses, zero.mode(belief)))
    if not len(records):
        raise LimitError("no orientation is within reach, joint range, tilt limit and singularity margin")
    gains = criterion.gain(belief.covariance, records.jacobian, records.covariance)
    search = _PathSearch.at(belief, zero, start, reference_command)
    for ranked in _batches(_ranking(belief, records, gains), COMMAND_BATCH):
        commands, found = commands_for(belief, records.targets[ranked])
        for few in _batches(np.flatnonzero(found), PATH_BATCH):
            rows = ranked[few]
            if selected := search.first_safe(records[rows], commands[few], gains[rows]):
                return selected
    raise LimitError("no orientation surely keeps the ball inside the gauges' travel")


def select_from_list(
    belief: RobotBelief,
    zero: GaugeZero,
    commands: PoseBatch,
    start: PoseBatch | None = None,
    *,
    reference_command: PoseBatch | None = None,
    skipped: int = 0,
) -> SelectedPose:
    """The first of some commands (n) that almost surely stays inside the travel.

    As :func:`select_pose`; the list's order takes the place of the gain. The first ``skipped`` of those
    inside the travel are left out.

    Raises:
        LimitError: none of them does.
    """
    targets, rows = outcomes_of(belief, commands)
    records = predict_records(belief, zero, targets)
    inside = np.flatnonzero(records.within(TRAVEL_SHARE * belief.limits.gauge_travel_mm))[skipped:]
    search = _PathSearch.at(belief, zero, start, reference_command)
    no_preference = np.full(len(inside), np.inf)
    selected = search.first_safe(records[inside], commands[rows[inside]], no_preference)
    if selected is None:
        raise LimitError(
            "none of the poses left in the list surely keeps the ball inside the gauges' travel"
        )
    return selected


def _ranking(belief: RobotBelief, records: PredictedRecords, gains: Array) -> Rows:
    """Rows of the records inside the travel by linear propagation, the best first."""
    rows = np.flatnonzero(records.within(TRAVEL_SHARE * belief.limits.gauge_travel_mm))
    return rows[np.argsort(-gains[rows], kind="stable")][:MOST_CANDIDATES]


@dataclass(frozen=True, slots=True, eq=False)
class _PathSearch:
    """Search for candidates that can be reached safely, all from one command."""

    belief: RobotBelief
    travel: TravelConstraint
    planner: PathPlanner

    @classmethod
    def at(
        cls,
        belief: RobotBelief,
        zero: GaugeZero,
        start: PoseBatch | None,
        reference_command: PoseBatch | None,
    ) -> _PathSearch:
        """The search at a point whose gauges were zeroed at ``zero``."""
        start = zero.command(belief) if start is None else start
        planner = PathPlanner(belief, start, reference_command, zero.reference)
        return cls(belief, TravelConstraint(belief, zero), planner)

    def first_safe(
        self, records: PredictedRecords, commands: PoseBatch, gains: Array
    ) -> SelectedPose | None:
        """The first of some ranked candidates with a safe path to it."""
        if not len(records):
            return None
        paths, rows = self.planner.options(commands), np.flatnonzero(self.travel.holds(records))
        found = self._first(paths.straight, rows)
        worth_waypoints = rows
        if found is not None:
            better = rows[rows < found[0]]
            worth_waypoints = better[gains[better] >= WAYPOINT_GAIN_RATIO * gains[found[0]]]
        found = (
            self._first(paths.via_waypoints, worth_waypoints)
            or found
            or self._first(paths.via_reference, rows)
        )
        if found is None:
            return None
        row, path = found
        return self._selected(records[np.array([row])], commands.pose(row), path.waypoints)

    def _first(self, paths_to: Callable[[Rows], list[Path | None]], rows: Rows) -> tuple[int, Path] | None:
        """The first row with a path along which the ball stays inside, and the path."""
        for row, path in zip(rows.tolist(), paths_to(rows), strict=True):
            if path is not None and self.travel.holds_along(path):
                return row, path
        return None

    def _selected(
        self, record: PredictedRecords, command: Pose, waypoints: tuple[Pose, ...]
    ) -> SelectedPose:
        gain = D_OPTIMAL.gain(self.belief.covariance, record.jacobian, record.covariance)
        return SelectedPose(
            command=command,
            joints=record.targets.joints[0],
            deviation=record.deviation[0],
            sigma=record.sigma[0],
            gain=float(gain[0]),
            jacobian=record.jacobian[0],
            covariance=record.covariance[0],
            waypoints=waypoints,
        )


def _batches(rows: Rows, size: int) -> Iterator[Rows]:
    return (rows[first : first + size] for first in range(0, len(rows), size))
