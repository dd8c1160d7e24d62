"""Check of straight lines between commands: limits of commands and robot, singularities, gauge travel.

A line is sampled. Joint ranges and what may be commanded are checked on a fine sampling of the commands.
The singularity margin is checked on a coarser one, for the controller's geometry and for the estimated one;
both must keep their assembly mode. Tilt, passive joints and legs there are those of the estimated robot,
and the ball's distance from the reference is computed from its path. Whether a robot can stand at a command
is the same question without a line.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.commanded_motion import ActualPoses
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array, Mask
from hexacell.kinematics.sensitivity import has_singularity_margin, margin_and_mode
from hexacell.motion.trajectory import interpolate_lines, trace_path

MARGIN_SHARE = 0.7
"""Share of the singularity margin that is kept between the ends. At the ends all of it is kept."""

JOINT_REFINEMENT = 4
"""How many times finer joint ranges are sampled, which costs little."""


def ball_position(belief: RobotBelief, command: PoseBatch) -> Array | None:
    """The estimated position (3,), mm, of the ball at a command (1); None if it cannot be taken."""
    actual = belief.commanded.actual_poses(command)
    return np.asarray(actual.poses.positions[0]) if actual.found[0] else None


def is_clear(belief: RobotBelief, start: PoseBatch, end: PoseBatch, reference: Array | None = None) -> bool:
    """Whether the line between two commands (1 each) keeps the limits; see :class:`LinesFrom`."""
    return bool(LinesFrom(belief, start, reference).check(end).is_clear[0])


@dataclass(frozen=True, slots=True, eq=False)
class CheckedLines:
    """Lines (n) from one command to others, and the estimated robot's motion along them.

    Attributes:
        commands: sampled commands (pieces + 1, n).
        joints: (pieces + 1, n, 6), mm.
        actual: actual poses of the estimated robot; meaningless on lines that are not ``is_open``.
        is_open: (n,) lines that keep all limits but the gauges' travel.
        is_clear: (n,) lines that are open and keep the ball inside the gauges' travel.
    """

    commands: PoseBatch
    joints: Array
    actual: PoseBatch
    is_open: Mask
    is_clear: Mask


@dataclass(frozen=True, eq=False)
class LinesFrom:
    """Lines from one command.

    Attributes:
        start: the command (1).
        reference: where the ball was when the gauges were zeroed (3,), mm: a clear line keeps it inside
            their travel. None without gauges.
    """

    belief: RobotBelief
    start: PoseBatch
    reference: Array | None = None

    def check(
        self, ends: PoseBatch, waypoints: Sequence[PoseBatch] = (), *, thorough: bool = True
    ) -> CheckedLines:
        """Check the lines to other commands (n), straight or over waypoints (n each).

        Unless the search is ``thorough``, about one clear line in fifty is reported as not clear.
        """
        belief = self._belief
        limits = belief.limits
        fine = interpolate_lines((self.start, *waypoints, ends), JOINT_REFINEMENT, limits.frames)
        fine_joints = belief.commanded.joints(fine.in_shape(-1)).reshape(
            -1, len(ends), belief.mechanism.joint_count
        )
        allowed = limits.allow_commands(fine.in_shape(-1)).reshape(-1, len(ends))
        rows = np.flatnonzero((allowed & limits.allow_joints(fine_joints)).all(axis=0))
        commands, joints = fine[::JOINT_REFINEMENT], fine_joints[::JOINT_REFINEMENT]
        rows = rows[self._keeps_margin(belief.controller, commands, joints, rows)]
        actual, rows = self._trace(commands, joints, rows, thorough=thorough)
        rows = rows[self._keeps_margin(belief.estimate, actual, joints, rows)]
        at = actual[:, rows].in_shape(-1), joints[:, rows].reshape(-1, joints.shape[-1])
        kept = belief.keeps_limits(*at, self._wanted_margins).reshape(len(joints), len(rows))
        rows = rows[kept.all(axis=0)]
        is_open = np.zeros(len(ends), dtype=bool)
        is_open[rows] = True
        is_inside = is_open.copy()
        if self.reference is not None:
            deviations = actual.positions[:, rows] - self.reference
            is_inside[rows] = limits.within_travel(deviations).all(axis=0)
        return CheckedLines(commands, joints, actual, is_open, is_inside)

    def _keeps_margin(
        self, geometry: Geometry, poses: PoseBatch, joints: Array, rows: NDArray[np.intp]
    ) -> Mask:
        """Which of some lines stay clear of the singularities of a geometry."""
        least = MARGIN_SHARE * self.belief.limits.singularity_margin
        at = poses[:, rows].in_shape(-1), joints[:, rows].reshape(-1, joints.shape[-1])
        found = margin_and_mode(self.belief.mechanism, geometry, *at, least)
        # A singularity between two samples shows as another assembly mode beyond it.
        keeps, mode = (one.reshape(len(joints), len(rows)) for one in found)
        clear: Mask = np.all(keeps & (mode == mode[:1]), axis=0)
        return clear

    def _trace(
        self, commands: PoseBatch, joints: Array, rows: NDArray[np.intp], *, thorough: bool
    ) -> tuple[PoseBatch, NDArray[np.intp]]:
        """Actual poses along some lines, and the rows of those without a singularity."""
        if not len(rows) or not self.actual_start.found[0]:
            return commands, rows[:0]
        actual, found = trace_path(
            self.belief.mechanism,
            self.belief.estimate,
            commands[:, rows],
            joints[:, rows],
            self.actual_start.poses,
            thorough=thorough,
        )
        return commands.with_rows(np.s_[:, rows], actual), rows[found]

    @cached_property
    def _belief(self) -> RobotBelief:
        """The robot that may be beyond a limit where it stands, and come back from there."""
        if not self.actual_start.found[0]:
            return self.belief
        return self.belief.standing_at(self.start, self.actual_start, self._wanted_margins)

    @cached_property
    def _wanted_margins(self) -> Array:
        """Margins of passive joints and legs. With gauges at the ball the choice of records checks more."""
        if self.reference is not None or not self.actual_start.found[0]:
            return self.belief.least_margins
        return np.asarray(self.belief.margins_at(self.actual_start)[0])

    @cached_property
    def actual_start(self) -> ActualPoses:
        """Where the estimated robot is at the start."""
        return self.belief.commanded.actual_poses(self.start)


def stands_within_limits(belief: RobotBelief, commands: PoseBatch, *, certainly: bool) -> Mask:
    """At which of n commands the estimated robot keeps its limits and is clear of singularities.

    Of singularities, as the line from a command to itself is; see :func:`is_clear`. ``certainly``: so that
    it also keeps the limits of passive joints and legs for what is not known of it.
    """
    limits, actual = belief.limits, belief.commanded.actual_poses(commands)
    found = np.flatnonzero(actual.found)
    at = actual[found]
    wanted = belief.margins_at(at) if certainly else belief.least_margins
    margins = limits.leg_margins(belief.mechanism, belief.estimate, at.poses, at.joints)
    kept = limits.allow_poses(at.poses, at.joints) & (margins >= wanted).all(axis=-1)
    least = MARGIN_SHARE * limits.singularity_margin
    for geometry, poses in ((belief.controller, commands[found]), (belief.estimate, at.poses)):
        kept &= has_singularity_margin(belief.mechanism, geometry, poses, at.joints, least)
    stands = np.array(actual.found)
    stands[found] = kept
    return stands
