"""A robot at a pose as a scene: base, drives, numbered legs, platform, ball, gauges and axes.

Rails, cranks and fixed joints need no numbers of their own: where the joints at the legs' base ends go,
while the drives move from end to end, tells which of these carries them.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.drawing.shapes import AXIS_ROLES, Ball, Label, Line, Role, Scene, Shape, Surface
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import Branch, Mechanism, inverse_kinematics
from hexacell.kinematics.parameters import LEGS, JointUnit
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array

TRACK_POINTS = 25
"""Places of a drive from end to end, of which the middle one tells a curve from a straight line."""

FLAT = 0.02
"""Points are in one plane if they are apart from it by a smaller share of their extent."""

NUMBER_AT = (0.22, 0.4, 0.58)
"""Where legs have their numbers, from the base's end to the platform: apart where neighbours cross."""

MOTOR, MOTOR_WEIGHT, GAUGE_WEIGHT = 0.15, 2.5, 4.0
"""Half the length of a motor by its crank; times the width of a line: of a motor, of a gauge's body."""

BALL, DRIVE, JOINT, GAUGE, AXIS, WORD = 0.13, 0.07, 0.05, (0.13, 0.42, 0.8), 0.9, 0.1
"""Shares of :meth:`DrawnRobot.size`: radii of ball, sliders and joints; from the ball to the plunger, body
and end of a gauge; length of an axis; from these to their words."""

OF_LEGS = 0.35
"""That size is no larger share of the legs' mean length."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnRobot:
    """A robot that can be drawn, in the frames of its geometry.

    Attributes:
        lowest: smallest joint variables (6,), in the unit of the mechanism.
        highest: the largest.
        gauge_signs: of the gauges along x, y and z: 1 on the positive side of the ball, -1 on the other, as
            they count up when their plungers are pushed in.
    """

    mechanism: Mechanism
    geometry: Geometry
    branch: Branch
    lowest: Array
    highest: Array
    gauge_signs: tuple[int, int, int] = (1, 1, 1)

    def joints(self, pose: Pose) -> Array:
        """The joint variables (1, 6) of a pose.

        Raises:
            ReachError: the pose is out of a leg's reach.
        """
        return inverse_kinematics(self.mechanism, self.geometry, self.branch, PoseBatch.of([pose]))

    def legs(self, pose: Pose, joints: Array) -> Legs:
        """The legs at a pose for each of some joint variables (n, 6)."""
        rows = PoseBatch.of([pose])[[0] * len(joints)]
        return self.mechanism.legs(self.geometry, rows, joints)

    def size(self, pose: Pose) -> float:
        """By what all sizes are chosen, mm: from the ball to the platform's joints, less for short legs."""
        legs = self.legs(pose, self.joints(pose))
        lengths = np.linalg.norm(legs.base_joints - legs.platform_joints, axis=-1)
        radius = self.mechanism.platform_radius(self.geometry)
        return float(min(np.max(radius), OF_LEGS * lengths.mean()))

    def tracks(self, pose: Pose) -> Array:
        """Where each leg's joint at the base's end goes (6, m, 3), mm, from end to end of its drive."""
        share = np.linspace(0.0, 1.0, TRACK_POINTS)[:, None]
        joints = (1.0 - share) * self.lowest + share * self.highest
        return np.swapaxes(self.legs(pose, joints).base_joints, 0, 1)


def robot_scene(robot: DrawnRobot, pose: Pose) -> Scene:
    """The whole robot at a pose, with its gauges and the axes of its base frame.

    Raises:
        ReachError: the pose is out of a leg's reach.
    """
    return Scene((*base_shapes(robot, pose), *moved_shapes(robot, pose)))


def base_shapes(robot: DrawnRobot, pose: Pose) -> Iterator[Shape]:
    """What does not move: fixed joints, rails, or the motors of cranks; and the axes of the base frame.

    These are at its origin, or at the base where the ball would cover them.
    """
    tracks, size = robot.tracks(pose), robot.size(pose)
    yield from _motors(tracks) if _has_cranks(robot) else _rails(tracks, JOINT * size)
    is_covered = np.linalg.norm(pose.position) < 2.0 * size
    origin = tracks.mean(axis=(0, 1)) if is_covered else np.zeros(3)
    for role, axis in zip(AXIS_ROLES, np.eye(3), strict=True):
        yield Line(role, origin + np.outer((0.0, AXIS * size), axis), has_head=True)
        yield Label(role, origin + np.outer((AXIS + WORD, AXIS), size * axis), f"+{role}")


def moved_shapes(robot: DrawnRobot, pose: Pose) -> Iterator[Shape]:
    """What moves with the pose: cranks or sliders, legs with their numbers, platform, ball, gauges."""
    legs, size = robot.legs(pose, robot.joints(pose)), robot.size(pose)
    starts, ends = legs.base_joints[0], legs.platform_joints[0]
    centres = crank_centres(robot.tracks(pose)) if _has_cranks(robot) else starts
    for leg in range(LEGS):
        if _has_cranks(robot):
            yield Line(Role.DRIVE, np.stack([centres[leg], starts[leg]]))
        yield Line(Role.LEG, np.stack([starts[leg], ends[leg]]))
        yield Ball(Role.DRIVE, starts[leg][None], DRIVE * size)
        yield Ball(Role.PLATFORM, ends[leg][None], JOINT * size)
        at = starts[leg] + NUMBER_AT[leg % len(NUMBER_AT)] * (ends[leg] - starts[leg])
        yield Label(Role.LEG, at[None], str(leg + 1))
    yield Surface(Role.PLATFORM, outline(ends))
    yield Line(Role.PLATFORM, np.stack([ends.mean(axis=0), pose.position]))
    yield Ball(Role.BALL, pose.position[None], BALL * size)
    yield from _gauges(robot.gauge_signs, pose.position, size)


def _gauges(signs: Iterable[int], ball: Array, size: float) -> Iterator[Shape]:
    for role, axis, sign in zip(AXIS_ROLES, np.eye(3), signs, strict=True):
        tip, front, back = (ball + sign * share * size * axis for share in GAUGE)
        yield Line(role, np.stack([tip, front]))
        yield Line(role, np.stack([front, back]), weight=GAUGE_WEIGHT)
        word = ball + np.outer((GAUGE[-1] + WORD, GAUGE[-1]), sign * size * axis)
        yield Label(role, word, f"gauge {role}")


def _rails(tracks: Array, joint: float) -> Iterator[Shape]:
    """Rails, or joints that stay where they are, and the base through their ends."""
    first, last = tracks[:, 0], tracks[:, -1]
    if np.linalg.norm(last - first, axis=-1).max() < joint:
        yield Surface(Role.BASE, outline(first))
        return
    for track in tracks:
        is_straight = _thickness(track, 1) < FLAT
        yield Line(Role.RAIL, track[[0, -1]] if is_straight else track)
    if _thickness(np.concatenate([first, last])) < FLAT:
        yield Surface(Role.BASE, outline(np.concatenate([first, last])))
        return
    lower, upper = sorted((first, last), key=lambda ends: float(ends[:, 2].mean()))
    yield Surface(Role.BASE, outline(lower))
    corners = outline(upper)
    yield Line(Role.BASE, np.concatenate([corners, corners[:1]]))


def _motors(tracks: Array) -> Iterator[Shape]:
    """The circles of the cranks' ends as far as they go, and the base through their centres."""
    centres = crank_centres(tracks)
    yield Surface(Role.BASE, outline(centres))
    for track, centre in zip(tracks, centres, strict=True):
        axis = np.cross(track[0] - centre, track[TRACK_POINTS // 2] - centre)
        axis *= MOTOR * np.linalg.norm(track[0] - centre) / np.linalg.norm(axis)
        yield Line(Role.BASE, track)
        yield Line(Role.DRIVE, np.stack([centre - axis, centre + axis]), weight=MOTOR_WEIGHT)


def _has_cranks(robot: DrawnRobot) -> bool:
    return robot.mechanism.words.joint_unit is JointUnit.DEG


def crank_centres(tracks: Array) -> Array:
    """The centres (6, 3) of the circles on which some tracks (6, m, 3) are."""
    start = tracks[:, 0]
    a, b = tracks[:, TRACK_POINTS // 2] - start, tracks[:, -1] - start
    normal = np.cross(a, b)
    squares = [np.sum(one * one, axis=-1, keepdims=True) for one in (a, b, normal)]
    toward = squares[0] * np.cross(b, normal) + squares[1] * np.cross(normal, a)
    return np.asarray(start + toward / (2.0 * squares[2]))


def outline(points: Array) -> Array:
    """The corners (m, 3) of the surface that points (n, 3) span, in their plane; two if it is a line."""
    from scipy.spatial import ConvexHull  # noqa: PLC0415 - a tenth of a second that only pictures need

    away = points - points.mean(axis=0)
    _, extents, (u, v, _) = np.linalg.svd(away)
    if extents[1] < FLAT * extents[0]:
        return points[np.argsort(away @ u)[[0, -1]]]
    return np.asarray(points[ConvexHull(np.stack([away @ u, away @ v], axis=-1)).vertices])


def _thickness(points: Array, dimensions: int = 2) -> float:
    """How far points (n, 3) are from being in a plane, or a line, as a share of their extent."""
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(extents[dimensions] / extents[0])
