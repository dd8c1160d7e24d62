"""The next pose for a robot that is not where the last record was taken."""

from dataclasses import replace

import pytest

from hexacell.campaign import pose_chooser
from hexacell.campaign.decisions import MeasurePose


@pytest.fixture
def at_points(campaign) -> list:
    """Some decisions on poses of the first point, where much is unknown, and of the second."""
    return [one for one in campaign if isinstance(one.decision, MeasurePose)][1::3]


def test_an_interrupted_run_goes_on_from_the_reference_where_no_line_leads_to_the_last_record(
    two_points, at_points, monkeypatch
) -> None:
    """It returned over waypoints that it does not know any more; the set must not be closed for that."""
    monkeypatch.setattr(pose_chooser, "find_route", lambda *_: None)
    for one in at_points:
        state = replace(one.state, present=two_points.reference_pose(one.decision.point))
        decided = two_points.decide(state)
        assert isinstance(decided, MeasurePose), decided
        assert decided.orientation == one.decision.orientation
        assert state.present not in decided.via


def test_where_a_line_leads_there_the_pose_is_that_of_an_undisturbed_run(two_points, at_points) -> None:
    for one in at_points:
        state = replace(one.state, present=two_points.reference_pose(one.decision.point))
        decided = two_points.decide(state)
        assert isinstance(decided, MeasurePose), decided
        assert decided.pose == one.decision.pose
