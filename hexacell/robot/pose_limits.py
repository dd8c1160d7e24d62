"""Which limits a pose would break if the controller were commanded to it, in words."""

from collections.abc import Iterator

import numpy as np

from hexacell.errors import ReachError
from hexacell.kinematics.mechanism import inverse_kinematics
from hexacell.kinematics.pose import AXES, Pose, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import singularity_margin
from hexacell.limits.leg_limits import ROUNDING
from hexacell.robot.model import Robot


def broken_limits(robot: Robot, pose: Pose) -> Iterator[str]:
    """What is wrong with a pose in the controller's frames: a sentence for each limit, with its value.

    Passive joints and legs are those of the geometry that the controller has.
    """
    yield from _of_command(robot, pose)
    poses = robot.from_commands([pose])
    try:
        joints = inverse_kinematics(robot.mechanism, robot.controller, robot.branch, PoseBatch.of([pose]))
    except ReachError as error:
        yield error.problem
        return
    unit = robot.mechanism.words.joint_unit
    for leg, (lowest, highest) in enumerate(robot.limits.joint_ranges):
        if not lowest <= joints[0, leg] <= highest:
            yield f"q{leg + 1} would be {joints[0, leg]:.1f} {unit}, outside {lowest:g} to {highest:g}"
    margin = singularity_margin(robot.mechanism, robot.commanding, poses, joints)[0]
    if margin < robot.limits.singularity_margin:
        yield f"the singularity margin is {margin:.3f}, below {robot.limits.singularity_margin:g}"
    yield from _of_legs(robot, poses, joints)


def _of_command(robot: Robot, pose: Pose) -> Iterator[str]:
    command, limits = PoseBatch.of([pose]), robot.limits
    for name, key, angle, largest in (
        ("is tilted", "tilt_deg", command.tilts()[0], limits.tilt),
        ("is turned about its normal", "turn_deg", abs(command.turns()[0]), limits.turn),
    ):
        if angle > largest + ROUNDING:
            yield f"{name} by {np.degrees(angle):.1f} deg, beyond {key} = {np.degrees(largest):g}"
    numbers, axes = command.numbers()[0], limits.axes
    for axis, number, low, high in zip(AXES, numbers, axes.lowest, axes.highest, strict=True):
        if not low - ROUNDING <= number <= high + ROUNDING:
            yield f"axis {axis} would be at {number:.1f}, outside {low:g} to {high:g}"


def _of_legs(robot: Robot, poses: PoseBatch, joints: Array) -> Iterator[str]:
    limits = robot.limits.legs
    if limits is None:
        return
    legs = robot.mechanism.legs(robot.commanding, poses, joints)
    spare = limits.spare_angles(legs)[0]
    for where, cones, left in zip(
        ("base", "platform"), (limits.base_cones, limits.platform_cones), spare, strict=True
    ):
        if left.min() < 0.0:
            leg = int(np.argmin(left))
            turned, cone = np.degrees([cones[leg] - left[leg], cones[leg]])
            yield f"leg {leg + 1} is turned by {turned:.1f} deg in its {where} joint, beyond {cone:g}"
    distance = legs.smallest_distance()[0]
    if distance < limits.distance_mm:
        yield f"two legs come within {distance:.1f} mm, leg_distance_mm is {limits.distance_mm:g}"
