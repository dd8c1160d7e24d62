"""Check of straight lines between commands: joint ranges, singularity margin and gauge travel.

A line is sampled. Joint ranges are checked on a fine sampling of the commands. The singularity margin is
checked on a coarser one, for the controller's geometry and for the estimated one; both must keep their
assembly mode. The ball's distance from the reference is computed from the estimated robot's actual path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import margin_and_mode
from hexacell.motion.trajectory import LineBatch, trace_path

MARGIN_SHARE = 0.7
"""Of the singularity margin, to be kept between the ends. At the ends all of it is kept."""

JOINT_REFINEMENT = 4
"""How many times finer joint ranges are sampled, which costs little."""


@dataclass(frozen=True, slots=True, eq=False)
class StartState:
    """Where lines begin.

    Attributes:
        command: commanded pose (1).
        actual: actual pose (1) of the estimated robot; none if it cannot take the command.
    """

    command: PoseBatch
    actual: PoseBatch | None


def start_state(belief: RobotBelief, command: PoseBatch) -> StartState:
    """Where the estimated robot is at a command (1)."""
    actual = belief.commanded.actual_poses(command)
    return StartState(command, actual.poses if actual.found[0] else None)


def ball_position(belief: RobotBelief, command: PoseBatch) -> Array | None:
    """The estimated position (3,), mm, of the ball at a command (1); none if it cannot be taken."""
    actual = start_state(belief, command).actual
    return None if actual is None else np.asarray(actual.positions[0])


def is_clear(belief: RobotBelief, start: PoseBatch, end: PoseBatch, reference: Array | None = None) -> bool:
    """Whether the straight line between two commands (1 each) keeps the limits; see :func:`check_lines`."""
    return bool(check_lines(belief, start_state(belief, start), end, reference).is_clear[0])


@dataclass(frozen=True, slots=True, eq=False)
class CheckedLines:
    """Lines (n) from one command to others, and the estimated robot's motion along them.

    Attributes:
        commands: sampled commands.
        joints: (pieces + 1, n, 6), mm.
        actual: actual poses of the estimated robot; meaningless on lines that are not ``is_open``.
        is_open: (n,) lines that keep joint ranges and singularity margin.
        is_clear: (n,) lines that are open and keep the ball inside the gauges' travel.
    """

    commands: LineBatch
    joints: Array
    actual: LineBatch
    is_open: Mask
    is_clear: Mask

    def traced(self, row: int) -> tuple[PoseBatch, Array]:
        """The actual poses on one line after its start, and their joint variables (m, 6), mm."""
        return self.actual.lines(np.array([row])).flat()[1:], self.joints[1:, row]


def check_lines(
    belief: RobotBelief,
    start: StartState,
    ends: PoseBatch,
    reference: Array | None = None,
    waypoints: Sequence[PoseBatch] = (),
    *,
    thorough: bool = True,
) -> CheckedLines:
    """Check lines from one command to others (n), straight or over waypoints (n each).

    With gauges zeroed where the ball was at ``reference`` (3,), mm, a clear line keeps the ball inside
    their travel. Unless the search is ``thorough``, about one clear line in fifty is reported as not
    clear.
    """
    limits = belief.limits
    fine = LineBatch.through((start.command, *waypoints, ends), JOINT_REFINEMENT)
    fine_joints = belief.commanded.joints(fine.flat()).reshape(*fine.shape, 6)
    in_range = (fine_joints >= limits.joint_min_mm) & (fine_joints <= limits.joint_max_mm)
    rows = np.flatnonzero(in_range.all(axis=(0, 2)))
    commands, joints = fine[::JOINT_REFINEMENT], fine_joints[::JOINT_REFINEMENT]
    rows = rows[_keeps_margin(belief, belief.controller, commands, joints, rows)]
    actual, rows = _trace(belief, start, commands, joints, rows, thorough=thorough)
    rows = rows[_keeps_margin(belief, belief.estimate, actual, joints, rows)]
    is_open = np.zeros(len(ends), dtype=bool)
    is_open[rows] = True
    is_inside = is_open.copy()
    if reference is not None:
        distance = np.abs(actual.positions[:, rows] - reference).max(axis=(0, 2), initial=0.0)
        is_inside[rows] = distance <= limits.gauge_travel_mm
    return CheckedLines(commands, joints, actual, is_open, is_inside)


def _keeps_margin(
    belief: RobotBelief, geometry: Geometry, poses: LineBatch, joints: Array, rows: NDArray[np.intp]
) -> Mask:
    """Which of some lines stay clear of the singularities of a geometry."""
    arguments = (belief.mechanism, geometry, poses.lines(rows).flat(), joints[:, rows].reshape(-1, 6))
    shape = (len(joints), len(rows))
    # A singularity between two samples shows as another assembly mode beyond it.
    least = MARGIN_SHARE * belief.limits.singularity_margin
    keeps, mode = (found.reshape(shape) for found in margin_and_mode(*arguments, least))
    clear: Mask = np.all(keeps & (mode == mode[:1]), axis=0)
    return clear


def _trace(
    belief: RobotBelief,
    start: StartState,
    commands: LineBatch,
    joints: Array,
    rows: NDArray[np.intp],
    *,
    thorough: bool,
) -> tuple[LineBatch, NDArray[np.intp]]:
    """Actual poses of the estimated robot along some lines, and the rows of those without a singularity."""
    if start.actual is None or not len(rows):
        return commands, rows[:0]
    traced = trace_path(
        belief.mechanism,
        belief.estimate,
        commands.lines(rows),
        joints[:, rows],
        start.actual,
        thorough=thorough,
    )
    return commands.with_lines(rows, traced.actual), rows[traced.found]
