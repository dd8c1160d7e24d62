"""How to get from one command to others with gauges at the ball.

A controller moves along a straight line of its own six numbers. Its geometry is wrong by millimetres,
and by other ones in every orientation, so that between two poses far apart the ball leaves the travel
though it is inside at both. There the way is led over stops at which the command gives way by as much
as the estimate says the ball would have moved.
"""

from __future__ import annotations

from collections.abc import Iterator
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

STOPS_AT = (1, PIECES // 3, 2 * PIECES // 3, PIECES - 1)
"""Pieces of the straight line after which the stops lie: closer together next to wide turns, where the
ball moves fastest."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """One way.

    Attributes:
        stops: commands to pass on the way.
        poses: where the estimated robot will be on it (m), and its ``joints`` (m, 6), mm.
        farthest: how far the ball gets from the reference along any axis, mm.
    """

    stops: tuple[Pose, ...]
    poses: PoseBatch
    joints: Array
    farthest: float

    def then(self, over: Pose, onward: Path) -> Path:
        """This way, and ``onward`` from the pose ``over`` at its end."""
        return Path(
            (*self.stops, over, *onward.stops),
            PoseBatch(
                np.concatenate([self.poses.positions, onward.poses.positions]),
                np.concatenate([self.poses.rotations, onward.poses.rotations]),
            ),
            np.concatenate([self.joints, onward.joints]),
            max(self.farthest, onward.farthest),
        )


@dataclass(frozen=True, eq=False)
class PathPlanner:
    """Leaving one command with gauges at the ball.

    Attributes:
        start: the command to leave from.
        home: the reference's command; none if that is where it starts.
        reference: where the ball was when the gauges were zeroed (3,), mm.
    """

    belief: RobotBelief
    start: PoseBatch
    home: PoseBatch | None
    reference: Array

    def to(self, ends: PoseBatch) -> list[Path | None]:
        """The ways to n commands, straight or else led, as far as there are."""
        return self.ways(ends).any()

    def ways(self, ends: PoseBatch) -> PathOptions:
        """All that lead to n commands."""
        return PathOptions(self, ends)

    @cached_property
    def beginning(self) -> StartState:
        """Where it leaves from."""
        return start_state(self.belief, self.start)

    @cached_property
    def from_home(self) -> PathPlanner | None:
        """Leaving the reference."""
        if self.home is None:
            return None
        return PathPlanner(self.belief, self.home, None, self.reference)

    @cached_property
    def back(self) -> Path | None:
        """The way to the reference."""
        return None if self.home is None else self.to(self.home)[0]


@dataclass(frozen=True, eq=False)
class PathOptions:
    """Ways from one command to n others; each manner answers for some ``rows`` of them."""

    departure: PathPlanner
    ends: PoseBatch

    def straight(self, rows: Rows) -> Iterator[Path | None]:
        """Straight ways that are clear in the sense of :func:`hexacell.motion.path_check.check_lines`."""
        return _passages(self._ahead, (), rows)

    def via_waypoints(self, rows: Rows) -> Iterator[Path | None]:
        """Ways over stops; of straight ones that are not open nothing says where to give way."""
        leading = np.flatnonzero(self._ahead.is_open[rows])
        if not len(leading):
            return iter([None] * len(rows))
        stops = tuple(self._giving_way(piece, rows[leading]) for piece in STOPS_AT)
        led = self._look_ahead(self.ends[rows[leading]], stops)
        places = np.full(len(rows), -1)
        places[leading] = np.arange(len(leading))
        return _passages(led, stops, places)

    def via_reference(self, rows: Rows) -> Iterator[Path | None]:
        """Ways over the reference.

        Lines between two large turns often lead through a singularity, where each of the two could
        be reached from the reference.
        """
        home, back, onward = self.departure.home, self.departure.back, self.departure.from_home
        if home is None or back is None or onward is None or not len(rows):
            return iter([None] * len(rows))
        over, ways = home.pose(0), onward.to(self.ends[rows])
        return (None if way is None else back.then(over, way) for way in ways)

    def any(self) -> list[Path | None]:
        """To each of them, straight or else led."""
        ways = list(self.straight(np.arange(len(self.ends))))
        rows = np.array([row for row, way in enumerate(ways) if way is None], dtype=np.intp)
        for row, way in zip(rows, self.via_waypoints(rows), strict=True):
            ways[row] = way
        return ways

    @cached_property
    def _ahead(self) -> CheckedLines:
        return self._look_ahead(self.ends)

    def _look_ahead(self, ends: PoseBatch, stops: tuple[PoseBatch, ...] = ()) -> CheckedLines:
        leave, thorough = self.departure, len(self.ends) == 1
        return check_lines(leave.belief, leave.beginning, ends, leave.reference, stops, thorough=thorough)

    def _giving_way(self, piece: int, rows: Rows) -> PoseBatch:
        """Commands on some lines after so many pieces, less what the ball is off the reference there."""
        commands, really = self._ahead.commands.at(piece, rows), self._ahead.actual.at(piece, rows)
        off = really.positions - self.departure.reference
        return PoseBatch(commands.positions - off, commands.rotations)


def _passages(ahead: CheckedLines, stops: tuple[PoseBatch, ...], rows: Rows) -> Iterator[Path | None]:
    """Some of n ways over n stops each; none where there is none, or the row is negative."""
    for row in rows.tolist():
        if row < 0 or not ahead.is_clear[row]:
            yield None
        else:
            over = tuple(stop.pose(row) for stop in stops)
            yield Path(over, *ahead.traced(row), float(ahead.farthest[row]))
