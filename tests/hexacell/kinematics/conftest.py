"""Inverse kinematics of the paper's robot."""

import pytest

from hexacell.kinematics.mechanism import inverse_kinematics


@pytest.fixture
def inverse(hexaglide, paper):
    return lambda geometry, at: inverse_kinematics(hexaglide, geometry, paper.branch, at)
