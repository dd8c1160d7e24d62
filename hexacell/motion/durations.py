"""How long moves take at the largest speeds of a cell.

A move must last so long that nothing on its way is faster than allowed. A controller that gets a duration
(inverse time, G93) passes the way at one rate of its parameter, so the fastest piece decides about all of
them. A feed rate would not do: it counts X, Y and Z only, so a platform that tilts about the ball has none.
"""

from dataclasses import dataclass

import numpy as np

from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.trajectory import interpolate_line

WAY_PIECES = 48
"""Pieces of a way, within which speeds hardly differ."""

SHORTEST_S = 0.1
"""Duration of a move that goes hardly anywhere, s."""


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """The largest speeds of any joint variable, and of the ball and the platform's joints, its edge."""

    joint: float
    edge_mm_s: float


def shortest_durations(joints: Array, points: Array, limits: SpeedLimits) -> Array:
    """The shortest durations (n,), s, of ways that are passed at a constant rate of their rows.

    The ways: ``joints`` (k, n, 6), mm, and ``points`` (k, n, m, 3), mm, of the platform's edge in the base
    frame, evenly in their parameter. Joints that are out of reach (NaN) do not count.
    """
    by_joints = np.abs(np.diff(joints, axis=0)).max(axis=-1) / limits.joint
    by_edge = np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=-1) / limits.edge_mm_s
    slowest = np.fmax.reduce(np.fmax(by_joints, by_edge), axis=0)
    return np.asarray(np.maximum(SHORTEST_S, slowest * (len(joints) - 1)))


def line_durations(
    mechanism: Mechanism,
    geometry: Geometry,
    branch: Branch,
    starts: PoseBatch,
    ends: PoseBatch,
    limits: SpeedLimits,
    pieces: int = WAY_PIECES,
) -> Array:
    """The shortest durations (n,), s, of a controller's straight lines from n poses to n others."""
    lines = interpolate_line(starts, ends, pieces)
    joints = mechanism.inverse(geometry, branch, lines)
    ways = (pieces + 1, len(ends), -1)
    edges = _edge(mechanism, geometry, lines, joints).reshape(*ways, 3)
    return shortest_durations(joints.reshape(ways), edges, limits)


def line_duration(
    mechanism: Mechanism, geometry: Geometry, branch: Branch, start: Pose, end: Pose, limits: SpeedLimits
) -> float:
    """The shortest duration, s, of a controller's straight line from ``start`` to ``end``."""
    ends = PoseBatch.of([start]), PoseBatch.of([end])
    return float(line_durations(mechanism, geometry, branch, *ends, limits)[0])


def approximate_durations(
    mechanism: Mechanism,
    geometry: Geometry,
    start: tuple[PoseBatch, Array],
    ends: tuple[PoseBatch, Array],
    limits: SpeedLimits,
) -> Array:
    """About how long straight lines from one pose to others last (n,), s, by their ends alone.

    ``start`` and ``ends`` are poses with joint variables: one and (1, 6), and n of each. Some lines last
    half as long again, on which joints or the edge are faster for a while.
    """
    (pose, joints), (poses, others) = start, ends
    turned = rotations.to_vector(poses.rotations @ pose.rotations[0].T)
    half = np.maximum(0.5 * np.linalg.norm(turned, axis=-1), 1e-9)
    arcs_per_chord = half / np.sin(np.minimum(half, 0.5 * np.pi))
    edges = _edge(mechanism, geometry, poses, others) - _edge(mechanism, geometry, pose, joints)
    by_edge = np.linalg.norm(edges, axis=2).max(axis=1) * arcs_per_chord / limits.edge_mm_s
    by_joints = np.abs(others - joints).max(axis=1) / limits.joint
    return np.asarray(np.maximum(np.fmax(by_joints, by_edge), SHORTEST_S))


def _edge(mechanism: Mechanism, geometry: Geometry, poses: PoseBatch, joints: Array) -> Array:
    """The ball and the platform's joints (n, 7, 3), mm, at n poses."""
    platform_joints = mechanism.legs(geometry, poses, joints).platform_joints
    return np.concatenate([poses.positions[:, None], platform_joints], axis=1)
