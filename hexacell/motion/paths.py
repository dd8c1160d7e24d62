"""Paths between commands: straight, over waypoints, over the reference, over poses known already.

A controller moves along a straight line of its own six numbers. Its geometry is wrong by millimetres, and
differently in every orientation. Between two orientations far apart the ball may therefore leave the
gauges' travel although it is inside at both ends. A path over waypoints corrects this: at some points of
the straight line the command is shifted back by the deviation that the estimate predicts there.

Lines between two large rotations often cross a singularity, though each end can be reached from the
reference. A path over the reference is therefore the third kind.

:func:`find_route` is a breadth-first search for the fewest straight lines over given poses. Its edges are
checked only when the search needs them, because a check costs far more than the search.

:func:`next_return_move` decides on the way back to a reference move by move. The path is planned from the
last pose that was to be measured, and kept while the robot is on it: planned again from a waypoint, it
could lead back and forth endlessly. Where no path can be planned the robot returns by the path on which
it came. A straight line to an earlier pose shortens that where it is clear.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import CheckedLines, LinesFrom, is_clear
from hexacell.motion.trajectory import PIECES

Rows = NDArray[np.intp]

WAYPOINT_PIECES = (1, PIECES // 3, 2 * PIECES // 3, PIECES - 1)
"""Pieces of the straight line after which the waypoints are: closer together near the ends, where
rotations are large and the ball moves fastest."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A path that keeps joint ranges, singularity margin and gauge travel, over commands as waypoints.

    ``poses`` are the actual ones (m) of the estimated robot along it, ``joints`` theirs (m, 6), mm.
    """

    waypoints: tuple[Pose, ...]
    poses: PoseBatch
    joints: Array

    def then(self, waypoint: Pose, onward: Path) -> Path:
        """This path, and ``onward`` from the ``waypoint`` at its end."""
        return Path(
            (*self.waypoints, waypoint, *onward.waypoints),
            PoseBatch.joined((self.poses, onward.poses)),
            np.concatenate([self.joints, onward.joints]),
        )


@dataclass(frozen=True, eq=False)
class PathPlanner:
    """Plans paths from one command.

    Attributes:
        start: the command (1) that paths start from.
        reference_command: the command (1) of the reference; None if paths start there.
        reference: where the ball was when the gauges were zeroed (3,), mm.
    """

    belief: RobotBelief
    start: PoseBatch
    reference_command: PoseBatch | None
    reference: Array

    def plan(self, ends: PoseBatch) -> list[Path | None]:
        """A path to each of n commands, straight or else over waypoints; None where there is neither."""
        options = self.options(ends)
        paths = options.straight(np.arange(len(ends)))
        blocked = np.array([row for row, path in enumerate(paths) if path is None], dtype=np.intp)
        for row, path in zip(blocked, options.via_waypoints(blocked), strict=True):
            paths[row] = path
        return paths

    def options(self, ends: PoseBatch) -> PathOptions:
        """The paths of each kind to n commands.

        A single line is searched thoroughly. Of several lines one that is hard to trace is left out:
        tracing it costs more than trying another end.
        """
        return PathOptions(self, ends, self.lines.check(ends, thorough=len(ends) == 1))

    @cached_property
    def lines(self) -> LinesFrom:
        """The lines from the start."""
        return LinesFrom(self.belief, self.start, self.reference)

    @cached_property
    def from_reference(self) -> PathPlanner | None:
        """The planner of paths from the reference; None if this one starts there."""
        if self.reference_command is None:
            return None
        return PathPlanner(self.belief, self.reference_command, None, self.reference)

    @cached_property
    def to_reference(self) -> Path | None:
        """The path to the reference; None if there is no path, or this planner starts there."""
        return None if self.reference_command is None else self.plan(self.reference_command)[0]


@dataclass(frozen=True, slots=True, eq=False)
class PathOptions:
    """Three kinds of path to n commands, each for some ``rows`` of them; None where there is no path."""

    planner: PathPlanner
    ends: PoseBatch
    lines: CheckedLines

    def straight(self, rows: Rows) -> list[Path | None]:
        """Straight paths."""
        return [_path(self.lines, (), row) for row in rows.tolist()]

    def via_waypoints(self, rows: Rows) -> list[Path | None]:
        """Paths over shifted waypoints, which are known only where the straight line is open."""
        is_open = self.lines.is_open[rows]
        if not is_open.any():
            return [None] * len(rows)
        waypoints = tuple(self._shifted(piece, rows[is_open]) for piece in WAYPOINT_PIECES)
        lines = self.planner.lines.check(self.ends[rows[is_open]], waypoints, thorough=len(self.ends) == 1)
        return [
            _path(lines, waypoints, place) if opened else None
            for place, opened in zip((np.cumsum(is_open) - 1).tolist(), is_open.tolist(), strict=True)
        ]

    def via_reference(self, rows: Rows) -> list[Path | None]:
        """Paths over the reference, each half straight or over waypoints."""
        back, onward = self.planner.to_reference, self.planner.from_reference
        if back is None or onward is None or not len(rows):
            return [None] * len(rows)
        reference = onward.start.pose(0)
        paths = onward.plan(self.ends[rows])
        return [None if path is None else back.then(reference, path) for path in paths]

    def _shifted(self, piece: int, rows: Rows) -> PoseBatch:
        """Commands on some lines after a piece, shifted back by the ball's deviation there."""
        commands, actual = self.lines.commands[piece, rows], self.lines.actual[piece, rows]
        deviation = actual.positions - self.planner.reference
        return PoseBatch(commands.positions - deviation, commands.rotations)


def _path(lines: CheckedLines, waypoints: tuple[PoseBatch, ...], row: int) -> Path | None:
    """One of the lines as a path, with one of n poses of each waypoint; None if it is not clear."""
    if not lines.is_clear[row]:
        return None
    commands = tuple(waypoint.pose(row) for waypoint in waypoints)
    return Path(commands, lines.actual[1:, [row]].in_shape(-1), lines.joints[1:, row])


def find_route(
    belief: RobotBelief,
    start: PoseBatch,
    end: PoseBatch,
    via: Sequence[PoseBatch],
    reference: Array | None = None,
) -> list[int] | None:
    """The fewest straight lines from ``start`` to ``end``: the rows of ``via`` between them, in order.

    An empty list where the straight line itself is clear; None where there is no route. With gauges
    zeroed where the ball was at ``reference`` (3,), mm, the ball stays inside their travel.
    """
    queue: deque[list[int]] = deque([[]])
    unvisited = list(range(len(via)))
    while queue:
        route = queue.popleft()
        here = via[route[-1]] if route else start
        if is_clear(belief, here, end, reference):
            return route
        reached = [row for row in unvisited if is_clear(belief, here, via[row], reference)]
        unvisited = [row for row in unvisited if row not in reached]
        queue.extend([*route, row] for row in reached)
    return None


def next_return_move(belief: RobotBelief, reference: Array, trail: PoseBatch, departure: int) -> int | Pose:
    """The next move back to the reference: a row of the trail, or a waypoint beside it.

    Args:
        belief: what is known of the robot.
        reference: where the ball was when the gauges were zeroed (3,), mm.
        trail: commands (m, 2 at least) from the reference's own to the present one.
        departure: the row of the last command that is not a waypoint.
    """
    here, home = trail[[-1]], trail[[0]]
    (path,) = PathPlanner(belief, trail[[departure]], None, reference).plan(home)
    waypoints = () if path is None else path.waypoints
    at_waypoint = PoseBatch.of([trail.pose(departure), *waypoints]).is_same(here)
    if path is not None and at_waypoint.any():
        passed = int(np.argmax(at_waypoint))
        return waypoints[passed] if passed < len(waypoints) else 0
    shortcuts = (row for row in range(len(trail) - 2) if is_clear(belief, here, trail[[row]], reference))
    return next(shortcuts, len(trail) - 2)
