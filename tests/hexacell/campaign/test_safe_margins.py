"""Passive joints keep their limits at chosen poses for what is not known of the robot."""

from collections.abc import Iterator

import numpy as np
import pytest

from hexacell.campaign.decisions import MeasurePose
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_chooser import FIRST_TURN
from hexacell.design import travel_monte_carlo
from hexacell.design.candidates import ReachableTargets, outcomes_of
from hexacell.design.predicted_records import predict_records
from hexacell.design.travel_monte_carlo import MARGIN_SIGMAS, TravelConstraint
from hexacell.identification.belief import SPARE_ANGLE, SPARE_SIGMAS
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import free_sensitivity
from tests.hexacell.campaign.conftest import Campaign, Taken

Choice = tuple[TravelConstraint, ReachableTargets]


def choices(plan: Plan, campaign: list[Taken]) -> Iterator[Choice]:
    """Each pose that was chosen when the orientation was no longer uncertain."""
    for one in campaign:
        if not isinstance(one.decision, MeasurePose):
            continue
        estimate = plan.estimate(one.state)
        constraint = TravelConstraint(estimate.belief, estimate.gauge_zero(one.decision.point))
        if not constraint.is_uncertain:
            commands = plan.robot.from_commands([one.decision.pose])
            yield constraint, outcomes_of(estimate.belief, commands)[0]


def margins(choice: Choice) -> tuple[Array, Array, Array]:
    """What is left by the estimate, its standard deviations, and what the orientation's would ask for."""
    constraint, targets = choice
    belief, zero = constraint.belief, constraint.zero.target
    at = (belief.mechanism, belief.estimate, targets.poses, targets.joints)
    sigmas = belief.margin_sigmas(targets.poses, targets.joints, free_sensitivity(*at))
    turn = SPARE_ANGLE + SPARE_SIGMAS * belief.orientation_sigma(zero.poses, zero.joints)
    return belief.limits.leg_margins(*at)[0], sigmas[0], belief.margins_for(turn)


@pytest.fixture(scope="module")
def chosen(two_points, campaign) -> list[Choice]:
    return list(choices(two_points, campaign))


def test_they_have_five_standard_deviations_left(chosen) -> None:
    assert len(chosen) > 10
    for choice in chosen:
        margin, sigma, by_orientation = margins(choice)
        kept = margin >= np.maximum(MARGIN_SIGMAS * sigma, choice[0].belief.least_margins)
        assert kept.all() or (margin >= by_orientation).all()


def test_a_pose_that_has_less_left_is_refused(chosen, monkeypatch) -> None:
    near = [one for one in chosen if not (margins(one)[0] >= margins(one)[2]).all()]
    assert len(near) > 3
    monkeypatch.setattr(travel_monte_carlo, "MARGIN_SIGMAS", 1e4)
    for constraint, targets in near:
        records = predict_records(constraint.belief, constraint.zero, targets)
        assert not constraint.holds(records).any()


def test_the_first_pose_of_all_turns_hardly(paper, make_plan) -> None:
    """With pilot poses and without."""
    for revisits in (0, 6):
        plan = make_plan(noise__revisits=revisits)
        taken = Campaign(plan, paper.actual).run(most=3)
        state = next(one.state for one in taken if len(one.state.measurements) == 2)
        reference, first = [record.pose for record in state.steering.records][:2]
        assert 0.0 < reference.angle_to(first) <= 1.05 * FIRST_TURN
