"""The steps within one set of poses, whatever it is measured for, and the verification of its reference."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.design.predicted_records import GaugeZero
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import deviation_of
from hexacell.robot.model import Robot
from procedures.calibration.path_planning import NoSafePath, RunPathPlanner
from procedures.run import events
from procedures.run.state import RunState
from procedures.run.steps import (
    CloseSet,
    Move,
    Place,
    Revisit,
    Sample,
    SetKey,
    SixNumbers,
    Step,
)

Known = tuple[RobotBelief, GaugeZero]
"""What is known of the robot, and where the ball was when a set's gauges were zeroed."""


class TravelError(LimitError):
    """A plunger is at an end of its travel where the gauges must be read."""


@dataclass(frozen=True, eq=False)
class SetSteps:
    """Steps of the sets of one robot."""

    robot: Robot

    @cached_property
    def paths(self) -> RunPathPlanner:
        """How to get to a pose from wherever the robot is."""
        return RunPathPlanner(self.robot)

    def at_pose(self, state: RunState, key: SetKey, orientation: int | None = None) -> Step | None:
        """Place the gauges or sample, if the robot is at the pose of the set's next record.

        That is the one of an ``orientation``, by default the lowest without a record.
        """
        orientation = orientation or state.set(key).next_orientation
        if state.at_pose != (key, orientation) or state.target is None:
            return None
        if orientation == 1 and not state.set(key).placed:
            return Place(at=key, pose=state.target)
        return Sample(at=key, orientation=orientation, pose=state.target)

    def at_reference(self, state: RunState, key: SetKey) -> Step | None:
        """Verify the set's reference, or close the set, if the robot is there."""
        if state.at_pose != (key, 1):
            return None
        return Revisit(at=key) if state.set(key).reference_unverified else CloseSet(at=key)

    def to_reference(self, state: RunState, key: SetKey, ball: Array | None) -> Move:
        """Move to the set's reference by a checked path.

        ``ball`` (3,), mm, is where the ball was when the gauges were zeroed, if that is known.
        """
        move = reference_move(state, key)
        if not state.refused.allows(move.pose):
            raise NoSafePath(
                f"{key}: the controller refuses its reference {move.target}, to which it must return",
                action="Widen the limits of the controller, then continue",
            )
        return self.paths.towards(state, move, ball)

    def way_back(self, state: RunState, key: SetKey, known: Known | None) -> Move:
        """The next move to the reference of the set in which the robot is.

        Raises:
            HexacellError: no safe path leads there.
        """
        back = self.paths.back(state, key, known)
        return back or self.to_reference(state, key, None if known is None else known[1].reference)


def reference_pose(state: RunState, key: SetKey) -> SixNumbers:
    """The pose of a set's first record."""
    pose = state.set(key).pose(1)
    assert pose is not None  # noqa: S101 - callers have a set with records
    return pose


def reference_move(state: RunState, key: SetKey) -> Move:
    """The straight move to a set's reference."""
    return Move(at=key, orientation=1, pose=reference_pose(state, key))


def require_zero(state: RunState, key: SetKey) -> None:
    """Raise ``TravelError`` if the gauges of a set could not be zeroed."""
    measured = state.set(key)
    if not measured.samples and measured.rejections:
        raise TravelError(f"{key}: the gauges cannot be zeroed, they are at the end of their travel")


def check_reference(
    at: SetKey, before: events.Reading, now: events.Reading, limit_mm: float, joint_limit: float
) -> events.ReferenceConfirmed | events.SetInvalidated:
    """Whether gauges and encoders show at a set's reference what they showed before.

    ``joint_limit`` is in the unit of the joint variables.
    """
    gauges = np.subtract(now.gauges_mm, before.gauges_mm)
    joints = np.subtract(now.joints, before.joints)
    if np.abs(gauges).max() > limit_mm:
        reason = f"back at its reference the gauges show {in_words(gauges)}, more than {limit_mm:g} mm"
        return events.SetInvalidated(at=at, reason=reason, reading=now)
    if np.abs(joints).max() > joint_limit:
        leg = int(np.abs(joints).argmax())
        reason = f"back at its reference q{leg + 1} shows {joints[leg]:+.3f}, more than {joint_limit:g}"
        return events.SetInvalidated(at=at, reason=reason, reading=now)
    return events.ReferenceConfirmed(at=at, change_mm=deviation_of(gauges), reading=now)


def in_words(deviation: Array) -> str:
    """Three numbers along x, y and z, mm."""
    return ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", deviation, strict=True))
