"""A robot at a pose as a scene: base, drives, numbered legs, platform, ball, gauges and axes.

Rails, cranks and fixed joints need no numbers of their own: where the joints at the legs' base ends go,
while the drives move from end to end, tells which of these carries them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hexacell.drawing.shapes import AXIS_ROLES, Form, Role, Scene, Shape
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import Branch, Mechanism, inverse_kinematics
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array

TRACK_POINTS = 25
"""Places of a drive from end to end."""

FLAT = 0.02
"""Points are in a plane, or in line, if they are apart from it by a smaller share of their extent."""

NUMBER_AT = (0.22, 0.4, 0.58)
"""Where legs have their numbers, from the base's end to the platform: apart where neighbours cross."""

MOTOR, MOTOR_WIDTH, GAUGE_WIDTH = 0.15, 2.5, 4.0
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
        """The joint variables (1, 6) of a pose; raises ``ReachError`` if it is out of reach."""
        return inverse_kinematics(self.mechanism, self.geometry, self.branch, PoseBatch.of([pose]))

    def legs(self, pose: Pose, joints: Array) -> Legs:
        """The legs at a pose for each of some joint variables (n, 6)."""
        return self.mechanism.legs(self.geometry, PoseBatch.of([pose] * len(joints)), joints)

    def size(self, pose: Pose) -> float:
        """By what all sizes are chosen, mm: from the ball to the platform's joints, less for short legs."""
        legs = self.legs(pose, self.joints(pose))
        lengths = np.linalg.norm(legs.base_joints - legs.platform_joints, axis=-1)
        return float(min(np.max(self.mechanism.platform_radius(self.geometry)), OF_LEGS * lengths.mean()))

    def tracks(self, pose: Pose) -> Array:
        """Where each leg's joint at the base's end goes (6, m, 3), mm, from end to end of its drive."""
        joints = np.linspace(self.lowest, self.highest, TRACK_POINTS)
        return np.swapaxes(self.legs(pose, joints).base_joints, 0, 1)

    @property
    def has_cranks(self) -> bool:
        """Whether its drives turn."""
        return self.mechanism.words.joint_unit is JointUnit.DEG


def robot_scene(robot: DrawnRobot, pose: Pose) -> Scene:
    """The whole robot at a pose, with its gauges and the axes of its base frame.

    Raises:
        ReachError: the pose is out of a leg's reach.
    """
    return (*base_shapes(robot, pose), *moved_shapes(robot, pose))


def base_shapes(robot: DrawnRobot, pose: Pose) -> Iterator[Shape]:
    """What does not move: fixed joints, rails, or the motors of cranks; and the axes of the base frame.

    These are at its origin, or at the base where the ball would cover them.
    """
    tracks, size = robot.tracks(pose), robot.size(pose)
    yield from _motors(tracks) if robot.has_cranks else _rails(tracks, JOINT * size)
    is_covered = np.linalg.norm(pose.position) < 2.0 * size
    origin = tracks.mean(axis=(0, 1)) if is_covered else np.zeros(3)
    for role, axis in zip(AXIS_ROLES, size * np.eye(3), strict=True):
        yield Shape(Form.ARROW, role, origin + np.outer((0.0, AXIS), axis))
        yield Shape(Form.WORD, role, origin + np.outer((AXIS + WORD, AXIS), axis), text=f"+{role}")


def moved_shapes(robot: DrawnRobot, pose: Pose) -> Iterator[Shape]:
    """What moves with the pose: cranks or sliders, legs with their numbers, platform, ball, gauges."""
    legs, size, ball = robot.legs(pose, robot.joints(pose)), robot.size(pose), pose.position
    starts, ends = legs.base_joints[0], legs.platform_joints[0]
    if robot.has_cranks:
        for ends_of_crank in np.stack([crank_centres(robot.tracks(pose)), starts], axis=1):
            yield Shape(Form.LINE, Role.DRIVE, ends_of_crank)
    for leg, (start, end) in enumerate(zip(starts, ends, strict=True)):
        yield Shape(Form.LINE, Role.LEG, np.stack([start, end]))
        yield Shape(Form.BALL, Role.DRIVE, start[None], DRIVE * size)
        yield Shape(Form.BALL, Role.PLATFORM, end[None], JOINT * size)
        at = start + NUMBER_AT[leg % len(NUMBER_AT)] * (end - start)
        yield Shape(Form.WORD, Role.LEG, at[None], text=str(leg + 1))
    yield Shape(Form.SURFACE, Role.PLATFORM, outline(ends))
    yield Shape(Form.LINE, Role.PLATFORM, np.stack([ends.mean(axis=0), ball]))
    yield Shape(Form.BALL, Role.BALL, ball[None], BALL * size)
    tip, front, back = GAUGE
    for role, axis, sign in zip(AXIS_ROLES, size * np.eye(3), robot.gauge_signs, strict=True):
        yield Shape(Form.LINE, role, ball + np.outer((tip, front), sign * axis))
        yield Shape(Form.LINE, role, ball + np.outer((front, back), sign * axis), GAUGE_WIDTH)
        yield Shape(
            Form.WORD, role, ball + np.outer((back + WORD, back), sign * axis), text=f"gauge {role}"
        )


def _rails(tracks: Array, joint: float) -> Iterator[Shape]:
    """Rails, or joints that stay where they are, and the base through their ends."""
    first, last = tracks[:, 0], tracks[:, -1]
    if np.linalg.norm(last - first, axis=-1).max() < joint:
        yield Shape(Form.SURFACE, Role.BASE, outline(first))
        return
    for track in tracks:
        yield Shape(Form.LINE, Role.RAIL, track)
    both = np.concatenate([first, last])
    extents = np.linalg.svd(both - both.mean(axis=0), compute_uv=False)
    if extents[2] < FLAT * extents[0]:
        yield Shape(Form.SURFACE, Role.BASE, outline(both))
        return
    lower, upper = sorted((outline(first), outline(last)), key=lambda corners: float(corners[:, 2].mean()))
    yield Shape(Form.SURFACE, Role.BASE, lower)
    yield Shape(Form.LINE, Role.BASE, np.concatenate([upper, upper[:1]]))


def _motors(tracks: Array) -> Iterator[Shape]:
    """The circles of the cranks' ends as far as they go, and the base through their centres."""
    centres = crank_centres(tracks)
    yield Shape(Form.SURFACE, Role.BASE, outline(centres))
    for track, centre in zip(tracks, centres, strict=True):
        axis = np.cross(track[0] - centre, track[TRACK_POINTS // 2] - centre)
        axis *= MOTOR * np.linalg.norm(track[0] - centre) / np.linalg.norm(axis)
        yield Shape(Form.LINE, Role.BASE, track)
        yield Shape(Form.LINE, Role.DRIVE, np.stack([centre - axis, centre + axis]), MOTOR_WIDTH)


def crank_centres(tracks: Array) -> Array:
    """The centres (6, 3) of the circles on which some tracks (6, m, 3) are."""
    a, b = (tracks[:, place] - tracks[:, 0] for place in (TRACK_POINTS // 2, -1))
    normal = np.cross(a, b)
    aa, bb, nn = (np.sum(one * one, axis=-1, keepdims=True) for one in (a, b, normal))
    return np.asarray(tracks[:, 0] + (aa * np.cross(b, normal) + bb * np.cross(normal, a)) / (2.0 * nn))


def outline(points: Array) -> Array:
    """The corners (m, 3) of the surface that points (n, 3) span, in their plane; two if it is a line."""
    from scipy.spatial import ConvexHull  # noqa: PLC0415 - a tenth of a second that only pictures need

    away = points - points.mean(axis=0)
    _, extents, (u, v, _) = np.linalg.svd(away)
    if extents[1] < FLAT * extents[0]:
        return points[np.argsort(away @ u)[[0, -1]]]
    return np.asarray(points[ConvexHull(np.stack([away @ u, away @ v], axis=-1)).vertices])
