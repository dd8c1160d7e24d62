"""The pose worth measuring next: the most informative one that surely stays inside the travel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.errors import LimitError
from hexacell.experiment_design import travel_monte_carlo
from hexacell.experiment_design.candidates import (
    ReachableTargets,
    commands_for,
    outcomes_of,
    reachable_targets,
)
from hexacell.experiment_design.criteria import D_OPTIMAL, Criterion
from hexacell.experiment_design.gauge_zero import GaugeZero
from hexacell.experiment_design.predicted_records import TRAVEL_SHARE, PredictedRecords, predict_records
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.motion.waypoint_planner import Path, PathPlanner, Rows

SelectionOptions = Callable[[Rows], Iterator[Path | None]]
"""Of getting to some of the candidates."""

NEAR_SHARE = 0.4
"""Of the travel. What stays within it does so even if the prediction is twice as wrong as it says, which
holds once the platform's orientation is known to a few degrees."""

MOST = 240
COMMANDED = 48
AT_ONCE = 4
"""Candidates that are tried, the best first; for so many at a time the command is searched, and for so
many the way, as one of the first will mostly do."""

ROUND_ABOUT = 1.2
"""How much more a pose must be worth for a way that is not straight, as each stop takes another move."""


@dataclass(frozen=True, slots=True, eq=False)
class SelectedPose:
    """The pose chosen.

    Attributes:
        command: what to send to the controller as it is configured now.
        joints: joint variables (6,), mm, it will go to.
        deviation: what the gauges are expected to show (3,), mm, and ``sigma`` (3,), mm.
        gain: information gained on the parameters, nat.
        change: Jacobian (3, p) of the deviation by the free parameters; ``noise`` its covariance
            (3, 3), mm^2, the parameters being known.
        stops: commands to pass on the way from where it was chosen to start; none on a straight line.
    """

    command: Pose
    joints: Array
    deviation: Array
    sigma: Array
    gain: float
    jacobian: Array
    covariance: Array
    stops: tuple[Pose, ...] = ()


def select_pose(
    belief: RobotBelief,
    at: GaugeZero,
    turns: Array,
    start: PoseBatch | None = None,
    goal: Criterion = D_OPTIMAL,
    home: PoseBatch | None = None,
) -> SelectedPose:
    """The best of some turns (n, 3, 3) away from the orientation at the zeroed reference.

    Turns start there and not at the untilted platform: with millimetres of error in the joints the
    platform may stand 20 degrees from where the controller believes it to be. From the command
    ``start``, by default that of the reference, a clear way must lead there, over the reference's
    own command ``home`` if it is told.

    Raises:
        LimitError: none of them is reachable within the limits and surely inside the travel.
    """
    targets = PoseBatch.at(at.reference, turns @ at.orientation)
    offered = predict_records(belief, at, reachable_targets(belief, targets, at.mode(belief)))
    if not len(offered):
        raise LimitError("no orientation is within reach, joint range, tilt limit and singularity margin")
    worth = goal.gain(belief.covariance, offered.jacobian, offered.covariance)
    rows = np.flatnonzero(offered.within(TRAVEL_SHARE * belief.limits.gauge_travel_mm))
    leave = PathPlanner(belief, at.command(belief) if start is None else start, home, at.reference)
    for some in _in_portions(rows[np.argsort(-worth[rows], kind="stable")][:MOST], COMMANDED):
        commands, held = commands_for(belief, offered.targets[some])
        for few in _in_portions(np.flatnonzero(held), AT_ONCE):
            tried = some[few]
            if choice := _first_safe(belief, at, offered[tried], commands[few], worth[tried], leave):
                return choice
    raise LimitError("no orientation surely keeps the ball inside the gauges' travel")


def select_from_list(
    belief: RobotBelief,
    at: GaugeZero,
    commands: PoseBatch,
    start: PoseBatch | None = None,
    *,
    home: PoseBatch | None = None,
    passed_over: int = 0,
) -> SelectedPose:
    """The first of some commands (n) that surely stays inside the travel, after so many passed over.

    Raises:
        LimitError: none of them does.
    """
    stands, rows = outcomes_of(belief, commands)
    offered = predict_records(belief, at, stands)
    inside = offered.within(TRAVEL_SHARE * belief.limits.gauge_travel_mm)
    kept = np.flatnonzero(inside)[passed_over:]
    leave = PathPlanner(belief, at.command(belief) if start is None else start, home, at.reference)
    alike = np.full(len(kept), np.inf)
    choice = _first_safe(belief, at, offered[kept], commands[rows[kept]], alike, leave)
    if choice is None:
        raise LimitError(
            "none of the poses left in the list surely keeps the ball inside the gauges' travel"
        )
    return choice


def _first_safe(
    belief: RobotBelief,
    at: GaugeZero,
    offered: PredictedRecords,
    commands: PoseBatch,
    worth: Array,
    leave: PathPlanner,
) -> SelectedPose | None:
    """The first pose to which a way leads with the ball inside.

    One to which no straight way leads comes first only where it is worth the moves that it takes
    more; over the reference, which takes most, the way leads where there is no other to any.
    """
    if not len(offered):
        return None
    ways, every = leave.ways(commands), _safe(belief, at, offered)

    def first(manner: SelectionOptions, rows: Rows) -> tuple[int, Path] | None:
        found = zip(rows.tolist(), manner(rows), strict=True)
        return next(((row, way) for row, way in found if way and _stays_inside(belief, at, way)), None)

    best = first(ways.straight, every)
    better = every
    if best is not None:
        before = every[every < best[0]]
        better = before[worth[before] >= ROUND_ABOUT * worth[best[0]]]
    best = first(ways.via_waypoints, better) or best or first(ways.via_reference, every)
    if best is None:
        return None
    row, way = best
    return _choice(belief, offered[np.array([row])], commands.pose(row), way.stops)


def _safe(belief: RobotBelief, at: GaugeZero, offered: PredictedRecords) -> Rows:
    """Which of some poses keep the ball inside; asked together they cost less than each on its way."""
    safe = _near(belief, at, offered)
    if not safe.all():
        safe[~safe] = _surely_inside(belief, at, offered.targets[~safe])
    return np.flatnonzero(safe)


def _stays_inside(belief: RobotBelief, at: GaugeZero, way: Path) -> bool:
    """Whether the ball surely does on a way.

    Every other pose is looked at; from one to the next little changes.
    """
    stands = ReachableTargets(way.poses[slice(None, None, -2)], way.joints[::-2])
    near = _near(belief, at, predict_records(belief, at, stands))
    return bool(near.all() or _surely_inside(belief, at, stands[~near]).all())


def _near(belief: RobotBelief, at: GaugeZero, offered: PredictedRecords) -> Mask:
    """Which poses need no closer look: straight propagation says near, and holds nearby."""
    is_known = travel_monte_carlo.orientation_sigma(belief, at.target) <= travel_monte_carlo.LITTLE_KNOWN
    near: Mask = offered.within(NEAR_SHARE * belief.limits.gauge_travel_mm) & is_known
    return near


def _surely_inside(belief: RobotBelief, at: GaugeZero, stands: ReachableTargets) -> Mask:
    """Which poses keep the ball inside the travel where straight error propagation may not hold."""
    return travel_monte_carlo.stays_in_travel(belief, at.joints, at.target.targets, stands)


def _choice(
    belief: RobotBelief, one: PredictedRecords, command: Pose, stops: tuple[Pose, ...]
) -> SelectedPose:
    return SelectedPose(
        command=command,
        joints=one.targets.joints[0],
        deviation=one.deviation[0],
        sigma=one.sigma[0],
        gain=float(D_OPTIMAL.gain(belief.covariance, one.jacobian, one.covariance)[0]),
        jacobian=one.jacobian[0],
        covariance=one.covariance[0],
        stops=stops,
    )


def _in_portions(rows: NDArray[np.intp], size: int) -> Iterator[NDArray[np.intp]]:
    return (rows[first : first + size] for first in range(0, len(rows), size))
