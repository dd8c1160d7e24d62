"""The chance constraint on sampled robots: excluding targets in stages excludes the same ones."""

from dataclasses import replace

import numpy as np
import pytest

from hexacell.design import travel_monte_carlo
from hexacell.design.candidates import orientations, reachable_targets
from hexacell.design.predicted_records import gauge_zero_at, predict_records
from hexacell.design.travel_monte_carlo import TravelConstraint
from hexacell.kinematics.pose import PoseBatch


@pytest.fixture(params=[2.0, 8.0])
def asked(know, little, limits, request):
    """The constraint after a few records, and candidates of which some keep it."""
    belief = know(little, limits=replace(limits, gauge_travel_mm=request.param))
    zero = gauge_zero_at(belief, little, 1)
    turned = orientations(64, float(np.radians(30.0)), seed=4) @ zero.orientation
    targets = reachable_targets(belief, PoseBatch.at(zero.reference, turned))
    return TravelConstraint(belief, zero), predict_records(belief, zero, targets)


def test_stages_exclude_what_all_samples_at_once_exclude(asked, monkeypatch):
    constraint, records = asked
    assert constraint.is_uncertain
    in_stages = constraint.holds(records)
    monkeypatch.setattr(travel_monte_carlo, "STAGES_UNCERTAIN", ())
    np.testing.assert_array_equal(in_stages, constraint.holds(records))
    assert in_stages.any()
    assert not in_stages.all()


def test_a_target_is_judged_alike_alone_and_among_others(asked):
    constraint, records = asked
    together = constraint.holds(records)
    rows = np.append(np.flatnonzero(together)[:3], np.flatnonzero(~together)[:3])
    for row in rows:
        assert constraint.holds(records[np.array([row])])[0] == together[row]
