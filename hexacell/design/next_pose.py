"""The pose worth measuring next: the most informative one that surely stays inside the travel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell import kinematics
from hexacell.design import second_order
from hexacell.design.candidates import Standing, commanded, standing
from hexacell.design.goal import D_OPTIMAL, Goal
from hexacell.design.knowledge import Knowledge
from hexacell.design.path import look_ahead
from hexacell.errors import LimitError
from hexacell.identification.model import record_covariance, record_weights
from hexacell.pose import Pose, Poses
from hexacell.rotations import Array, Mask

SAFETY_SIGMAS = 3.0
TRAVEL_SHARE = 0.9
"""Of the travel, for the predicted deviation and three sigma."""

STRAIGHT_SHARE = 0.4
"""Of the travel. What stays within it does so even if the prediction is twice as wrong as it says."""

AT_ONCE = 80
MOST_TRIED = 240
"""Candidates looked at closely, the best first, so many at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """The pose chosen.

    Attributes:
        command: what to send to the controller as it is configured now.
        joints: joint variables (6,), mm, it will go to.
        deviation: what the gauges are expected to show (3,), mm, and ``sigma`` (3,), mm.
        gain: information gained on the parameters, nat.
    """

    command: Pose
    joints: Array
    deviation: Array
    sigma: Array
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """What is known of the zeroed gauges at a point.

    Attributes:
        reference: where the estimate says the ball was when they were zeroed (3,), mm.
        orientation: the platform's then (3, 3), under the estimate.
        joints: the sliders' positions then (6,), mm.
        jacobian: derivative (3, p) of ``reference`` by the free parameters.
        covariance: of ``reference`` (3, 3), mm^2, the parameters being known.
    """

    reference: Array
    orientation: Array
    joints: Array
    jacobian: Array
    covariance: Array

    def command(self, knowledge: Knowledge) -> Poses:
        """The command, one of one, that led to the reference."""
        there = Standing(Poses.at(self.reference, self.orientation[None]), self.joints[None])
        return commanded(knowledge, there)[0]


def station(knowledge: Knowledge, poses: Poses, joints: Array, deviations: Array) -> Station:
    """The station of a point's records so far (n): their poses under the estimate, the first at zero.

    Raises:
        LimitError: all of them stand at a singularity, where nothing can be said.
    """
    jacobian, by_joints = _derivatives(knowledge, Standing(poses, joints))
    weights = record_weights(by_joints, knowledge.noise)
    try:
        covariance = np.linalg.inv(weights.sum(axis=0))
    except np.linalg.LinAlgError:
        raise LimitError("the records of this point say nothing about where the ball is") from None
    reference = covariance @ np.einsum("nij,nj->i", weights, poses.positions - deviations)
    mean = covariance @ np.einsum("nij,njp->ip", weights, jacobian)
    return Station(reference, poses.rotations[0], joints[0], mean, covariance)


def choose(
    knowledge: Knowledge,
    at: Station,
    turns: Array,
    start: Poses | None = None,
    goal: Goal = D_OPTIMAL,
) -> Choice:
    """The best of some turns (n, 3, 3) away from the orientation at the zeroed reference.

    Turns start there and not at the untilted platform: with millimetres of error in the joints the
    platform may stand 20 degrees from where the controller believes it to be. From the command
    ``start``, by default that of the reference, a straight line must lead there.

    Raises:
        LimitError: none of them is reachable within the limits and surely inside the travel.
    """
    offered = _offered(knowledge, at, turns)
    if not len(offered.stands):
        raise LimitError("no orientation is within reach, joint range, tilt limit and singularity margin")
    worth = goal.worth(knowledge.covariance, offered.change, offered.noise)
    rows = np.flatnonzero(offered.within(TRAVEL_SHARE * knowledge.limits.gauge_travel_mm))
    start = at.command(knowledge) if start is None else start
    for some in _a_few_at_once(rows[np.argsort(-worth[rows], kind="stable")]):
        if choice := _first_safe(knowledge, at, offered[some], start):
            return choice
    raise LimitError("no orientation surely keeps the ball inside the gauges' travel")


def _first_safe(knowledge: Knowledge, at: Station, offered: _Offered, start: Poses) -> Choice | None:
    """The first pose that the controller can be commanded to from ``start`` with the ball inside."""
    commands, held = commanded(knowledge, offered.stands)
    rows = np.flatnonzero(held)
    if not len(rows):
        return None
    ahead = look_ahead(knowledge, start, commands[rows], at.reference)
    for place in np.flatnonzero(ahead.clear):
        row = int(rows[place])
        straight = STRAIGHT_SHARE * knowledge.limits.gauge_travel_mm
        is_straight = ahead.farthest[place] <= straight and offered.within(straight)[row]
        if is_straight or _surely_inside(knowledge, at, *ahead.way(int(place))):
            return offered.choice(knowledge, row, commands.pose(row))
    return None


def _surely_inside(knowledge: Knowledge, at: Station, way: Poses, joints: Array) -> bool:
    """Whether a way keeps the ball inside the travel where straight error propagation may not hold."""
    reference = Poses.at(at.reference, at.orientation[None])
    return bool(second_order.inside(knowledge, at.joints, reference, Standing(way, joints)).all())


def _a_few_at_once(rows: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    for first in range(0, min(len(rows), MOST_TRIED), AT_ONCE):
        yield rows[first : first + AT_ONCE]


@dataclass(frozen=True, slots=True, eq=False)
class _Offered:
    """Poses to choose from, and the records (n) they would give.

    Attributes:
        change: Jacobians (n, 3, p) of the deviations; ``noise`` their covariance (n, 3, 3), mm^2,
            the parameters being known.
        deviation: expected (n, 3), mm, and its ``sigma`` (n, 3), mm.
    """

    stands: Standing
    change: Array
    noise: Array
    deviation: Array
    sigma: Array

    def __getitem__(self, rows: NDArray[np.intp]) -> _Offered:
        return _Offered(
            self.stands[rows], self.change[rows], self.noise[rows], self.deviation[rows], self.sigma[rows]
        )

    def within(self, distance_mm: float) -> Mask:
        """Which deviations stay within a distance on every axis, with three sigma."""
        farthest = np.abs(self.deviation) + SAFETY_SIGMAS * self.sigma
        within: Mask = (farthest <= distance_mm).all(axis=-1)
        return within

    def choice(self, knowledge: Knowledge, row: int, command: Pose) -> Choice:
        """One of them."""
        gain = D_OPTIMAL.worth(knowledge.covariance, self.change[[row]], self.noise[[row]])
        return Choice(
            command, self.stands.joints[row], self.deviation[row], self.sigma[row], float(gain[0])
        )


def _offered(knowledge: Knowledge, at: Station, turns: Array) -> _Offered:
    stands = standing(knowledge, Poses.at(at.reference, turns @ at.orientation))
    jacobian, by_joints = _derivatives(knowledge, stands)
    noise = record_covariance(by_joints, knowledge.noise) + at.covariance
    change = jacobian - at.jacobian
    spread = change @ knowledge.covariance @ np.swapaxes(change, -1, -2) + noise
    sigma = np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1))
    return _Offered(stands, change, noise, stands.targets.positions - at.reference, sigma)


def _derivatives(knowledge: Knowledge, stands: Standing) -> tuple[Array, Array]:
    sensitivity = kinematics.sensitivity(
        knowledge.mechanism, knowledge.estimate, stands.targets, stands.joints
    )
    return sensitivity.parameters[:, :3] @ knowledge.basis, sensitivity.joints[:, :3]
