"""Paths from one command to others with gauges at the ball: straight, over waypoints, over the reference.

A controller moves along a straight line of its own six numbers. Its geometry is wrong by millimetres, and
differently in every orientation. Between two orientations far apart the ball may therefore leave the
gauges' travel although it is inside at both ends. A path over waypoints corrects this: at some points of
the straight line the command is shifted back by the deviation that the estimate predicts there.

Lines between two large rotations often cross a singularity, though each end can be reached from the
reference. A path over the reference is therefore the third kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import CheckedLines, StartState, check_lines, start_state
from hexacell.motion.trajectory import PIECES

Rows = NDArray[np.intp]

WAYPOINT_PIECES = (1, PIECES // 3, 2 * PIECES // 3, PIECES - 1)
"""Pieces of the straight line after which the waypoints are: closer together near the ends, where
rotations are large and the ball moves fastest."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A path that keeps joint ranges, singularity margin and gauge travel.

    Attributes:
        waypoints: commands between its ends.
        poses: actual poses (m) of the estimated robot along it, and their ``joints`` (m, 6), mm.
    """

    waypoints: tuple[Pose, ...]
    poses: PoseBatch
    joints: Array

    def then(self, waypoint: Pose, onward: Path) -> Path:
        """This path, and ``onward`` from the ``waypoint`` at its end."""
        return Path(
            (*self.waypoints, waypoint, *onward.waypoints),
            PoseBatch.concatenate((self.poses, onward.poses)),
            np.concatenate([self.joints, onward.joints]),
        )


@dataclass(frozen=True, eq=False)
class PathPlanner:
    """Plans paths from one command.

    Attributes:
        start: the command (1) that paths start from.
        reference_command: the command (1) of the reference; none if paths start there.
        reference: where the ball was when the gauges were zeroed (3,), mm.
    """

    belief: RobotBelief
    start: PoseBatch
    reference_command: PoseBatch | None
    reference: Array

    def plan(self, ends: PoseBatch) -> list[Path | None]:
        """A path to each of n commands, straight or else over waypoints; none where there is neither."""
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
        return PathOptions(self, ends, self.check(ends, thorough=len(ends) == 1))

    def check(
        self, ends: PoseBatch, waypoints: tuple[PoseBatch, ...] = (), *, thorough: bool
    ) -> CheckedLines:
        """Check lines from the start to n commands, straight or over waypoints (n each)."""
        return check_lines(
            self.belief, self._start_state, ends, self.reference, waypoints, thorough=thorough
        )

    @cached_property
    def from_reference(self) -> PathPlanner | None:
        """The planner of paths from the reference; none if this one starts there."""
        if self.reference_command is None:
            return None
        return PathPlanner(self.belief, self.reference_command, None, self.reference)

    @cached_property
    def to_reference(self) -> Path | None:
        """The path to the reference; none if there is none, or this planner starts there."""
        return None if self.reference_command is None else self.plan(self.reference_command)[0]

    @cached_property
    def _start_state(self) -> StartState:
        return start_state(self.belief, self.start)


@dataclass(frozen=True, slots=True, eq=False)
class PathOptions:
    """Three kinds of path to n commands, each for some ``rows`` of them; none where there is no path.

    Attributes:
        lines: the straight lines.
    """

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
        lines = self.planner.check(self.ends[rows[is_open]], waypoints, thorough=len(self.ends) == 1)
        places = np.cumsum(is_open) - 1
        return [
            _path(lines, waypoints, place) if opened else None
            for place, opened in zip(places.tolist(), is_open.tolist(), strict=True)
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
        commands, actual = self.lines.commands.at(piece, rows), self.lines.actual.at(piece, rows)
        deviation = actual.positions - self.planner.reference
        return PoseBatch(commands.positions - deviation, commands.rotations)


def _path(lines: CheckedLines, waypoints: tuple[PoseBatch, ...], row: int) -> Path | None:
    """One of the lines as a path, with one of n poses of each waypoint; none if it is not clear."""
    if not lines.is_clear[row]:
        return None
    return Path(tuple(waypoint.pose(row) for waypoint in waypoints), *lines.traced(row))
