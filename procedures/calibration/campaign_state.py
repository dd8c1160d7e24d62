"""The state of a run as the campaign knows it."""

from __future__ import annotations

from hexacell.campaign.decisions import CampaignState
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet
from procedures.run.state import RunState, record
from procedures.run.steps import Phase, SetKey


def campaign_state(state: RunState, key: SetKey | None) -> CampaignState:
    """The run as the campaign knows it, with an open set or none.

    Records are in the order in which their sets were measured.
    """
    sets = {at: measured for at, measured in state.sets.items() if at.phase is Phase.IDENTIFY}
    records = tuple(record(sample) for measured in sets.values() for sample in measured.samples)
    return CampaignState(
        measurements=MeasurementSet(records),
        point=None if key is None else key.point,
        done=frozenset(at.point for at, measured in sets.items() if measured.closed) | _left_points(state),
        present=_present_pose(state, key),
        rejections=0 if key is None else state.set(key).rejections,
        zero_mm=None if key is None else state.zero_shown(key),
        pilots=state.pilots,
    )


def _left_points(state: RunState) -> frozenset[int]:
    """Points that cannot be measured, because the controller refuses their reference."""
    keys = {refused.at for refused in state.excluded if refused.at.phase is Phase.IDENTIFY}
    return frozenset(key.point for key in keys if state.is_left(key))


def _present_pose(state: RunState, key: SetKey | None) -> Pose | None:
    """The pose that the robot was commanded to last, that of a rejected record included.

    Between points none where it was brought by somebody: it can be brought elsewhere, too.
    """
    if state.target is not None and (key is not None or state.at_pose is not None):
        return Pose(*state.target)
    if key is None:
        return None
    samples = state.set(key).samples
    return Pose(*samples[-1].pose) if samples else None
