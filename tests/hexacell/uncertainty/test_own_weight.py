"""The platform's own weight loads the legs: stated, it makes no healthy machine doubtful."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from hexacell.identification.estimator import identify
from hexacell.identification.placement import Placement, Weight, leg_forces
from hexacell.uncertainty.effect_kinds import own_weight
from hexacell.uncertainty.effects import Occurrence, errors_by_effects
from tests.hexacell.altered_records import altered

DOWN = np.array([0.0, 0.0, -1.0])
CENTRE_MM = np.array([10.0, -5.0, -90.0])
NEWTON, UM_PER_N = 100.0, 0.08
"""A compliance at which the records of the paper's robot show it."""


@pytest.fixture(scope="module")
def placement(noisy, make_problem):
    found = identify(make_problem(noisy))
    return Placement(found.problem.mechanism, found.geometry, found.poses, found.problem.joints)


def test_the_legs_hold_the_weight_in_balance(placement):
    forces = leg_forces(placement, Weight(DOWN, CENTRE_MM))
    legs = placement.mechanism.legs(placement.geometry, placement.poses, placement.joints)
    # A leg that is pulled draws the platform towards its base.
    pulls = forces[..., None] * legs.directions
    arms = legs.platform_joints - placement.poses.positions[:, None, :]
    np.testing.assert_allclose(pulls.sum(axis=1), np.tile(-DOWN, (len(placement), 1)), atol=1e-9)
    moment = np.cross(placement.poses.rotations @ CENTRE_MM, -DOWN)
    np.testing.assert_allclose(np.cross(arms, pulls).sum(axis=1), moment, atol=1e-6)


def test_a_stated_weight_makes_no_healthy_machine_doubtful(noisy, make_problem, placement):
    """Without it the residuals are too large, and a person would look for a fault."""
    forces = NEWTON * leg_forces(placement, Weight(DOWN, CENTRE_MM))
    moved = np.einsum("nij,nj->ni", placement.by_constraints, 1e-3 * UM_PER_N * forces)[:, :3]
    rows = {record.id: row for row, record in enumerate(noisy.records)}
    loaded = altered(noisy, lambda r: {"deviation": np.array(r.deviation) + moved[rows[r.id]]})
    problem = make_problem(loaded)
    unstated = identify(problem)
    assert not unstated.goodness.is_explained
    for centre in (CENTRE_MM, None):
        effect = own_weight(NEWTON, UM_PER_N, Weight(DOWN, centre))
        assert effect.occurrence is Occurrence.CONSTANT
        stated = identify(replace(problem, systematic=partial(errors_by_effects, (effect,))))
        assert stated.goodness.is_explained
