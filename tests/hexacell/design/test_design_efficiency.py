"""The bound of all designs over a robot's poses, beside poses and designs that it has not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hexacell.design.continuous_design.certificate import Linearization
from hexacell.design.continuous_design.measure import PointMeasure
from hexacell.design.continuous_design.optimality import DOptimality, IOptimality
from hexacell.design.continuous_design.pose_bound import GAP
from hexacell.design.design_efficiency import CampaignMeasure, design_efficiency

UNSEEN = 4096
BEYOND = 0.02
"""What poses that took no part may exceed the certificate by."""


@pytest.fixture(scope="module")
def campaign(know, much, limits):
    return CampaignMeasure.of(know(much, limits=replace(limits, turn=np.radians(60.0))), much)


@pytest.fixture(scope="module")
def bound(campaign):
    return campaign.bound(DOptimality())


def test_the_campaign_as_a_design_has_the_information_of_its_identification(campaign):
    np.testing.assert_allclose(campaign.design.information()[0], campaign.information, rtol=1e-9, atol=1e-6)


def test_the_bound_has_as_many_records_as_the_campaign(campaign, bound):
    counts = [one.share for one in campaign.design.points]
    assert [one.share for one in bound.design.points] == pytest.approx(counts, rel=1e-9)
    assert counts == [10.0] * 5


def test_unseen_poses_confirm_the_certificate(campaign, bound):
    at = Linearization.at(bound.design, DOptimality())
    largest = [
        float(at.sensitivities(point, domain.records(domain.spread(UNSEEN, 999))).max())
        for point, domain in enumerate(campaign.domains)
    ]
    assert bound.certificate >= 1.0 - GAP
    assert at.least_efficiency(largest) >= bound.certificate - BEYOND


def test_no_random_campaign_is_better(campaign, bound):
    random = np.random.default_rng(7)
    for seed in range(3):
        points = []
        for one, domain in zip(campaign.design.points, campaign.domains, strict=True):
            records = domain.records(domain.spread(128, seed))
            some = records[random.integers(0, len(records), 10)]
            points.append(PointMeasure(one.fixed, some, np.ones(10)))
        other = replace(campaign.design, points=tuple(points)).information()[0]
        assert DOptimality().efficiency(other, bound.information) * bound.certificate <= 1.0


def test_random_orientations_are_far_from_efficient(know, much, campaign, bound):
    """Angles within 30 deg: much less than what tilts of 45 deg give."""
    found = campaign.efficiency(DOptimality(), bound)
    assert 0.1 < found.certified <= found.value < 0.8


@pytest.mark.slow
def test_a_certificate_is_also_given_for_the_task(know, much, limits):
    belief = know(much, limits=replace(limits, turn=np.radians(60.0)))
    predictions = np.eye(len(belief.free))[:6]
    found = design_efficiency(belief, much, predictions)
    assert found.i is not None
    assert 0.0 < found.i.certified <= found.i.value < 1.0
    measure = CampaignMeasure.of(belief, much)
    variance = np.trace(predictions @ np.linalg.inv(measure.information) @ predictions.T)
    best = measure.bound(IOptimality(predictions)).information
    assert np.trace(predictions @ np.linalg.inv(best) @ predictions.T) < variance
    assert design_efficiency(belief, much).i is None
