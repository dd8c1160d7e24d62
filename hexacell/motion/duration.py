"""How long a move must last so that nothing on its way is faster than allowed.

A controller that is told a duration (inverse time, G93) passes the way at one rate of its parameter, so the
fastest piece decides about all of them. A feed rate would not do: it counts X, Y and Z only, so a platform
that tilts about the ball has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.trajectory import interpolate_line

WAY_PIECES = 48
"""Pieces of a way, within which speeds hardly differ."""

SHORTEST_S = 0.1
"""Of a move that goes hardly anywhere."""


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """The largest speeds of any joint variable, and of the ball and the platform's joints, its edge."""

    joint: float
    edge_mm_s: float


def shortest_duration(joints: Array, points: Array, limits: SpeedLimits) -> float:
    """The shortest duration, s, of a way that is passed at a constant rate of its rows.

    The way: ``joints`` (k, 6), mm, and ``points`` (k, m, 3) of the platform's edge in the base frame, mm,
    evenly in its parameter. Joints that are out of reach (NaN) do not count.
    """
    by_joints = np.abs(np.diff(joints, axis=0)).max(axis=1) / limits.joint
    by_edge = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1) / limits.edge_mm_s
    slowest = float(np.fmax(by_joints, by_edge).max())
    return max(SHORTEST_S, slowest * (len(joints) - 1))


@dataclass(frozen=True, slots=True, eq=False)
class LineDurations:
    """Durations of a controller's straight lines under one geometry."""

    mechanism: Mechanism
    geometry: Geometry
    branch: Branch

    def of(self, start: Pose, end: Pose, limits: SpeedLimits) -> float:
        """The shortest duration, s, of the line from ``start`` to ``end``."""
        line = interpolate_line(PoseBatch.of([start]), PoseBatch.of([end]), WAY_PIECES)
        joints = self.mechanism.inverse(self.geometry, self.branch, line)
        legs = self.mechanism.legs(self.geometry, line, joints)
        return shortest_duration(
            joints, np.concatenate([line.positions[:, None], legs.platform_joints], axis=1), limits
        )
