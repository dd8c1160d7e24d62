"""The way between two commanded poses, checked before it is taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import margin_and_mode
from hexacell.motion.trajectory import LineBatch, trace_path

MARGIN_SHARE = 0.7
"""Of the singularity margin, on the way. The ends keep all of it."""

FINER = 4
"""Times as many places at which reach and joint ranges are looked at, which costs little."""


@dataclass(frozen=True, slots=True, eq=False)
class StartState:
    """Where lines begin.

    Attributes:
        command: what the controller was told (1).
        actual: where the estimated robot is then (1); none if it cannot be there.
    """

    command: PoseBatch
    actual: PoseBatch | None


def start_state(belief: RobotBelief, command: PoseBatch) -> StartState:
    """Where the estimated robot is, being told to be at a command (1)."""
    joints = belief.mechanism.inverse(belief.controller, belief.branch, command)
    if np.isnan(joints).any():
        return StartState(command, None)
    found = continue_solution(
        belief.mechanism,
        belief.estimate,
        joints,
        start=command,
        start_geometry=belief.controller,
        start_joints=joints,
    )
    return StartState(command, found.poses if found.found[0] else None)


def is_clear(belief: RobotBelief, start: PoseBatch, end: PoseBatch, reference: Array | None = None) -> bool:
    """Whether the straight line between two commands keeps to the limits; see :func:`check_lines`."""
    return bool(check_lines(belief, start_state(belief, start), end, reference).is_clear[0])


@dataclass(frozen=True, slots=True, eq=False)
class CheckedLines:
    """Lines (n) from one command to others, as the estimated robot would go them.

    Attributes:
        commands: what is commanded on the way.
        joints: (pieces + 1, n, 6), mm.
        actual: where the estimated robot is then; of lines that are not ``open`` it says nothing.
        open: (n,) which of them keep to joint range and singularity margin.
        farthest: (n,), mm, along any axis: how far the ball gets from the reference; 0 without one.
        clear: (n,) which of them are open and keep the ball inside the travel.
    """

    commands: LineBatch
    joints: Array
    actual: LineBatch
    is_open: Mask
    farthest: Array
    is_clear: Mask

    def traced(self, row: int) -> tuple[PoseBatch, Array]:
        """The poses on one of the lines after its beginning, and their joint variables."""
        return self.actual.lines(np.array([row])).flat()[1:], self.joints[1:, row]


def check_lines(
    belief: RobotBelief,
    start: StartState,
    ends: PoseBatch,
    reference: Array | None = None,
    stops: Sequence[PoseBatch] = (),
    *,
    thorough: bool = True,
) -> CheckedLines:
    """Lines (n) from one command to others: straight, or straight from stop to stop (n each).

    Joint ranges and the singularity margin hold all along a clear one, by the controller's geometry
    and by the estimated one. With the gauges at a ``reference`` (3,), mm, the ball stays inside their
    travel. One line in fifty is wrongly not clear unless the search is ``thorough``.
    """
    limits = belief.limits
    closely = LineBatch.through((start.command, *stops, ends), FINER)
    sliders = belief.mechanism.inverse(belief.controller, belief.branch, closely.flat())
    sliders = sliders.reshape(*closely.shape, 6)
    in_range = (sliders >= limits.joint_min_mm) & (sliders <= limits.joint_max_mm)
    rows = np.flatnonzero(in_range.all(axis=(0, 2)))
    commands, joints = closely[::FINER], sliders[::FINER]
    rows = rows[_clear_of_singularities(belief, belief.controller, commands, joints, rows)]
    really, rows = _followed(belief, start, commands, joints, rows, thorough=thorough)
    rows = rows[_clear_of_singularities(belief, belief.estimate, really, joints, rows)]
    is_open, farthest = np.zeros(len(ends), dtype=bool), np.zeros(len(ends))
    is_open[rows] = True
    if reference is not None:
        farthest[rows] = np.abs(really.positions[:, rows] - reference).max(axis=(0, 2), initial=0.0)
    clear: Mask = is_open & (farthest <= limits.gauge_travel_mm)
    return CheckedLines(commands, joints, really, is_open, farthest, clear)


def _clear_of_singularities(
    belief: RobotBelief, geometry: Geometry, ways: LineBatch, joints: Array, rows: NDArray[np.intp]
) -> Mask:
    """Which of some lines a robot with this geometry goes clear of singularities."""
    arguments = (belief.mechanism, geometry, ways.lines(rows).flat(), joints[:, rows].reshape(-1, 6))
    shape = (len(joints), len(rows))
    # Between two of the poses looked at a singularity may lie unseen; beyond it the mode is another.
    least = MARGIN_SHARE * belief.limits.singularity_margin
    keeps, mode = (found.reshape(shape) for found in margin_and_mode(*arguments, least))
    clear: Mask = np.all(keeps & (mode == mode[:1]), axis=0)
    return clear


def _followed(
    belief: RobotBelief,
    start: StartState,
    ways: LineBatch,
    joints: Array,
    rows: NDArray[np.intp],
    *,
    thorough: bool,
) -> tuple[LineBatch, NDArray[np.intp]]:
    """The estimated robot led along some lines, and those that it can be led along."""
    if start.actual is None or not len(rows):
        return ways, rows[:0]
    went = trace_path(
        belief.mechanism,
        belief.estimate,
        ways.lines(rows),
        joints[:, rows],
        start.actual,
        thorough=thorough,
    )
    positions, turns = ways.positions.copy(), ways.rotations.copy()
    positions[:, rows], turns[:, rows] = went.actual.positions, went.actual.rotations
    return LineBatch(positions, turns), rows[went.found]
