"""Stops reached from one side: over a waypoint at which every joint stands short of its place at the stop.

From there all joints move in the same direction, and each has gone through its lost motion when it arrives
(unidirectional positioning, ISO 230-2). Where a joint stops then differs from what its encoder shows by the
same amount at every stop, which is the same as another zero of its encoder.
"""

import numpy as np

from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.forward import continue_solution
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.motion.path_check import ball_position, is_clear

SPARE = 1.5
"""Times the way after which a joint has surely gone through its lost motion."""

BACKLASH_SIGMAS = 3.0
"""Standard deviations of what is stated of the backlash that an overshoot exceeds."""


def overshoot(least: float, backlash: float) -> float:
    """How far every joint stands short of its place, in its unit.

    ``least`` is as of ``least_way``, ``backlash`` one standard deviation of what is stated of it.
    """
    return SPARE * max(least, BACKLASH_SIGMAS * backlash)


def waypoint_before(belief: RobotBelief, stop: PoseBatch, back: float | Array) -> PoseBatch | None:
    """The command (1) at which every joint stands short of a stop (1); None if there is none.

    Args:
        belief: what is known of the robot.
        stop: a command.
        back: by how much its joints, or each of them (6,), go up from the waypoint to the stop; below 0 if
            they go down.
    """
    joints = belief.commanded.joints(stop)
    if not np.isfinite(joints).all():
        return None
    found = continue_solution(
        belief.mechanism,
        belief.controller,
        joints - back,
        start=stop,
        start_geometry=belief.controller,
        start_joints=joints,
    )
    return found.poses if found.found[0] else None


def clear_waypoint_before(
    belief: RobotBelief,
    start: PoseBatch | None,
    stop: PoseBatch,
    back: float | Array,
    reference: Array | None,
) -> PoseBatch | None:
    """The waypoint before a stop if the way over it keeps the limits and the gauges' travel; else None.

    Args:
        belief: as of :func:`waypoint_before`, with ``stop`` and ``back``.
        start: the command (1) at which the robot is; None where that is not known.
        stop: a command.
        back: by how much.
        reference: where the ball was when the gauges were zeroed (3,), mm; None without gauges. On the way
            from a start outside their travel it may be outside, too.
    """
    waypoint = waypoint_before(belief, stop, back)
    # From the stop, within the limits: a robot that begins beyond one may come back from there.
    if waypoint is None or not is_clear(belief, stop, waypoint, reference):
        return None
    if start is None:
        return waypoint
    ball = ball_position(belief, start)
    if reference is not None and (ball is None or not belief.limits.within_travel(ball - reference)):
        reference = None
    return waypoint if is_clear(belief, start, waypoint, reference) else None
