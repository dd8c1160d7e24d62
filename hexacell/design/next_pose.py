"""The pose worth measuring next: the most informative one that surely stays inside the travel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.design import second_order
from hexacell.design.candidates import Standing, commanded, led, standing
from hexacell.design.goal import D_OPTIMAL, Goal
from hexacell.design.knowledge import Knowledge
from hexacell.design.offer import TRAVEL_SHARE, Offer, offer
from hexacell.design.passage import Departure, Passage, Rows
from hexacell.design.station import Station
from hexacell.errors import LimitError
from hexacell.pose import Pose, Poses
from hexacell.rotations import Array, Mask

Manner = Callable[[Rows], Iterator[Passage | None]]
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
class Choice:
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
    change: Array
    noise: Array
    stops: tuple[Pose, ...] = ()


def choose(
    knowledge: Knowledge,
    at: Station,
    turns: Array,
    start: Poses | None = None,
    goal: Goal = D_OPTIMAL,
    home: Poses | None = None,
) -> Choice:
    """The best of some turns (n, 3, 3) away from the orientation at the zeroed reference.

    Turns start there and not at the untilted platform: with millimetres of error in the joints the
    platform may stand 20 degrees from where the controller believes it to be. From the command
    ``start``, by default that of the reference, a clear way must lead there, over the reference's
    own command ``home`` if it is told.

    Raises:
        LimitError: none of them is reachable within the limits and surely inside the travel.
    """
    targets = Poses.at(at.reference, turns @ at.orientation)
    offered = offer(knowledge, at, standing(knowledge, targets, at.mode(knowledge)))
    if not len(offered):
        raise LimitError("no orientation is within reach, joint range, tilt limit and singularity margin")
    worth = goal.worth(knowledge.covariance, offered.change, offered.noise)
    rows = np.flatnonzero(offered.within(TRAVEL_SHARE * knowledge.limits.gauge_travel_mm))
    leave = Departure(knowledge, at.command(knowledge) if start is None else start, home, at.reference)
    for some in _in_portions(rows[np.argsort(-worth[rows], kind="stable")][:MOST], COMMANDED):
        commands, held = commanded(knowledge, offered.stands[some])
        for few in _in_portions(np.flatnonzero(held), AT_ONCE):
            tried = some[few]
            if choice := _first_safe(knowledge, at, offered[tried], commands[few], worth[tried], leave):
                return choice
    raise LimitError("no orientation surely keeps the ball inside the gauges' travel")


def choose_in_turn(
    knowledge: Knowledge,
    at: Station,
    commands: Poses,
    start: Poses | None = None,
    *,
    home: Poses | None = None,
    passed_over: int = 0,
) -> Choice:
    """The first of some commands (n) that surely stays inside the travel, after so many passed over.

    Raises:
        LimitError: none of them does.
    """
    stands, rows = led(knowledge, commands)
    offered = offer(knowledge, at, stands)
    inside = offered.within(TRAVEL_SHARE * knowledge.limits.gauge_travel_mm)
    kept = np.flatnonzero(inside)[passed_over:]
    leave = Departure(knowledge, at.command(knowledge) if start is None else start, home, at.reference)
    alike = np.full(len(kept), np.inf)
    choice = _first_safe(knowledge, at, offered[kept], commands[rows[kept]], alike, leave)
    if choice is None:
        raise LimitError(
            "none of the poses left in the list surely keeps the ball inside the gauges' travel"
        )
    return choice


def _first_safe(
    knowledge: Knowledge, at: Station, offered: Offer, commands: Poses, worth: Array, leave: Departure
) -> Choice | None:
    """The first pose to which a way leads with the ball inside.

    One to which no straight way leads comes first only where it is worth the moves that it takes
    more; over the reference, which takes most, the way leads where there is no other to any.
    """
    if not len(offered):
        return None
    ways, every = leave.ways(commands), _safe(knowledge, at, offered)

    def first(manner: Manner, rows: Rows) -> tuple[int, Passage] | None:
        found = zip(rows.tolist(), manner(rows), strict=True)
        return next(((row, way) for row, way in found if way and _stays_inside(knowledge, at, way)), None)

    best = first(ways.straight, every)
    better = every
    if best is not None:
        before = every[every < best[0]]
        better = before[worth[before] >= ROUND_ABOUT * worth[best[0]]]
    best = first(ways.led, better) or best or first(ways.over_home, every)
    if best is None:
        return None
    row, way = best
    return _choice(knowledge, offered[np.array([row])], commands.pose(row), way.stops)


def _safe(knowledge: Knowledge, at: Station, offered: Offer) -> Rows:
    """Which of some poses keep the ball inside; asked together they cost less than each on its way."""
    safe = _near(knowledge, at, offered)
    if not safe.all():
        safe[~safe] = _surely_inside(knowledge, at, offered.stands[~safe])
    return np.flatnonzero(safe)


def _stays_inside(knowledge: Knowledge, at: Station, way: Passage) -> bool:
    """Whether the ball surely does on a way.

    Every other pose is looked at; from one to the next little changes.
    """
    stands = Standing(way.poses[slice(None, None, -2)], way.joints[::-2])
    near = _near(knowledge, at, offer(knowledge, at, stands))
    return bool(near.all() or _surely_inside(knowledge, at, stands[~near]).all())


def _near(knowledge: Knowledge, at: Station, offered: Offer) -> Mask:
    """Which poses need no closer look: straight propagation says near, and holds nearby."""
    is_known = second_order.turn_sigma(knowledge, at.stand) <= second_order.LITTLE_KNOWN
    near: Mask = offered.within(NEAR_SHARE * knowledge.limits.gauge_travel_mm) & is_known
    return near


def _surely_inside(knowledge: Knowledge, at: Station, stands: Standing) -> Mask:
    """Which poses keep the ball inside the travel where straight error propagation may not hold."""
    return second_order.inside(knowledge, at.joints, at.stand.targets, stands)


def _choice(knowledge: Knowledge, one: Offer, command: Pose, stops: tuple[Pose, ...]) -> Choice:
    return Choice(
        command=command,
        joints=one.stands.joints[0],
        deviation=one.deviation[0],
        sigma=one.sigma[0],
        gain=float(D_OPTIMAL.worth(knowledge.covariance, one.change, one.noise)[0]),
        change=one.change[0],
        noise=one.noise[0],
        stops=stops,
    )


def _in_portions(rows: NDArray[np.intp], size: int) -> Iterator[NDArray[np.intp]]:
    return (rows[first : first + size] for first in range(0, len(rows), size))
