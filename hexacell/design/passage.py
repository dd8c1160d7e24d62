"""How to get from one command to others with gauges at the ball.

A controller moves along a straight line of its own six numbers. Its geometry is wrong by millimetres,
and by other ones in every orientation, so that between two poses far apart the ball leaves the travel
though it is inside at both. There the way is led over stops at which the command gives way by as much
as the estimate says the ball would have moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexacell.design.knowledge import Knowledge
from hexacell.design.lines import PIECES
from hexacell.design.path import Ahead, Beginning, beginning, look_ahead
from hexacell.pose import Pose, Poses
from hexacell.rotations import Array, Mask

STOPS_AT = (PIECES // 4, PIECES // 2, 3 * PIECES // 4)
"""Pieces of the straight line after which the stops lie."""


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """One way.

    Attributes:
        stops: commands to pass on the way.
        poses: where the estimated robot will be on it (m), and its ``joints`` (m, 6), mm.
        farthest: how far the ball gets from the reference along any axis, mm.
    """

    stops: tuple[Pose, ...]
    poses: Poses
    joints: Array
    farthest: float

    def then(self, over: Pose, onward: Passage) -> Passage:
        """This way, and ``onward`` from the pose ``over`` at its end."""
        return Passage(
            (*self.stops, over, *onward.stops),
            Poses(
                np.concatenate([self.poses.positions, onward.poses.positions]),
                np.concatenate([self.poses.rotations, onward.poses.rotations]),
            ),
            np.concatenate([self.joints, onward.joints]),
            max(self.farthest, onward.farthest),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Passages:
    """Ways (n) from one command to others.

    Attributes:
        clear: (n,) to which of them there is one.
    """

    clear: Mask
    _straight: Ahead
    _led: Ahead | None
    _rows: NDArray[np.intp]
    _stops: tuple[Poses, ...]

    def passage(self, row: int) -> Passage:
        """The way to one of those to which there is one."""
        if self._straight.clear[row]:
            return Passage((), *self._straight.way(row), float(self._straight.farthest[row]))
        assert self._led is not None  # noqa: S101 - it is clear, and not straight
        place = int(np.flatnonzero(self._rows == row)[0])
        stops = tuple(stop.pose(place) for stop in self._stops)
        return Passage(stops, *self._led.way(place), float(self._led.farthest[place]))


def passages(knowledge: Knowledge, start: Beginning, ends: Poses, reference: Array) -> Passages:
    """Ways (n) from one command to others with the ball inside the travel about ``reference`` (3,), mm.

    Straight ones where they are clear in the sense of :func:`hexacell.design.path.look_ahead`, else
    ones over stops that are. Of many it may overlook a few.
    """
    thorough = len(ends) == 1
    straight = look_ahead(knowledge, start, ends, reference, thorough=thorough)
    rows = np.flatnonzero(straight.open & ~straight.clear)
    if not len(rows):
        return Passages(straight.clear, straight, None, rows, ())
    stops = tuple(_giving_way(straight, piece, rows, reference) for piece in STOPS_AT)
    led = look_ahead(knowledge, start, ends[rows], reference, stops, thorough=thorough)
    clear = straight.clear.copy()
    clear[rows] = led.clear
    return Passages(clear, straight, led, rows, stops)


@dataclass(frozen=True, eq=False)
class Departure:
    """Ways from one command with gauges at the ball, over the point's reference if need be.

    Lines between two large turns often lead through a singularity, where each of the two could be
    reached from the reference.

    Attributes:
        start: the command to leave from.
        home: the reference's command; none if that is where it starts.
        reference: where the ball was when the gauges were zeroed (3,), mm.
    """

    knowledge: Knowledge
    start: Poses
    home: Poses | None
    reference: Array

    def to(self, ends: Poses) -> Passages:
        """Ways to n commands, straight or led."""
        return passages(self.knowledge, self._here, ends, self.reference)

    def over_home(self, ends: Poses) -> list[Passage | None]:
        """The ways to n commands over the reference, as far as there are."""
        if self.home is None or not len(ends) or self._back is None or self._home is None:
            return [None] * len(ends)
        back, home = self._back, self.home.pose(0)
        onward = passages(self.knowledge, self._home, ends, self.reference)
        return [
            back.then(home, onward.passage(row)) if onward.clear[row] else None for row in range(len(ends))
        ]

    @cached_property
    def _here(self) -> Beginning:
        return beginning(self.knowledge, self.start)

    @cached_property
    def _home(self) -> Beginning | None:
        return None if self.home is None else beginning(self.knowledge, self.home)

    @cached_property
    def _back(self) -> Passage | None:
        if self.home is None:
            return None
        ways = self.to(self.home)
        return ways.passage(0) if ways.clear[0] else None


def _giving_way(ahead: Ahead, piece: int, rows: NDArray[np.intp], reference: Array) -> Poses:
    """The commands on some lines after so many pieces, less what the ball is off the reference there."""
    commands, really = ahead.commands.at(piece, rows), ahead.really.at(piece, rows)
    return Poses(commands.positions - (really.positions - reference), commands.rotations)
