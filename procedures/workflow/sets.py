"""The steps within one set of poses, whatever it is measured for, and the verification of its reference."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hexacell.campaign.decisions import MeasurePose
from hexacell.campaign.pilots import pilot_number
from hexacell.design.predicted_records import GaugeZero
from hexacell.errors import LimitError
from hexacell.identification.belief import RobotBelief
from hexacell.kinematics.rotations import Array
from hexacell.robot.model import Robot
from procedures.run.keys import Phase, SetKey, SixNumbers
from procedures.run.state import RunState
from procedures.steps.close import CloseSet
from procedures.steps.move import Expectation, Move
from procedures.steps.place import Place
from procedures.steps.registry import Step
from procedures.steps.revisit import Revisit
from procedures.steps.sample import Sample
from procedures.workflow.paths import NoSafePath, RunPathPlanner

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


def move_to_chosen(state: RunState, chosen: MeasurePose) -> Move:
    """The move to the chosen pose, or to the first waypoint of its path."""
    at = SetKey(phase=Phase.IDENTIFY, point=chosen.point)
    if chosen.via:
        pose = chosen.via[0].as_tuple()
        by_pose = {sample.pose: sample.orientation for sample in state.set(at).samples}
        return Move(at=at, orientation=by_pose.get(pose, 0), pose=pose)
    is_pilot = pilot_number(chosen.orientation) is not None
    return Move(
        at=at,
        orientation=chosen.orientation if is_pilot else state.set(at).next_orientation,
        pose=chosen.pose.as_tuple(),
        expected=Expectation(
            deviation_mm=chosen.deviation,
            sigma_mm=chosen.sigma,
            gain=chosen.gain,
            forecast=chosen.forecast,
        ),
    )
