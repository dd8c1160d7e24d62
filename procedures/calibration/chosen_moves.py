"""The moves to the poses that the campaign chooses."""

from __future__ import annotations

from hexacell.campaign.decisions import MeasurePose
from hexacell.campaign.pilots import pilot_number
from procedures.run.state import RunState
from procedures.run.steps import Expectation, Move, Phase, SetKey


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
