"""Cones of passive joints and the distance of legs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hexacell.kinematics.legs import Legs
from hexacell.limits.leg_limits import LegLimits


def are_kept(limits, legs, wanted=0.0):
    return (limits.margins(legs) >= wanted).all(axis=-1)


def turned(axis, degrees):
    """Six parallel legs on a platform that is turned."""
    rotation = Rotation.from_rotvec(np.radians(degrees) * np.array(axis, dtype=float)).as_matrix()
    feet = 50.0 * np.stack([np.cos(np.arange(6)), np.sin(np.arange(6)), np.zeros(6)], axis=-1)
    return Legs(feet[None] + [0.0, 0.0, -500.0], feet[None], rotation[None])


def limits(cone=30.0, distance=0.0):
    down = np.tile([0.0, 0.0, -1.0], (6, 1))
    return LegLimits(down, down, np.full(6, np.radians(20.0)), np.full(6, np.radians(cone)), distance)


def test_a_platform_joint_turns_as_far_as_the_platform_does():
    spare = np.degrees(limits().spare_angles(turned([1, 0, 0], 12.0)))
    np.testing.assert_allclose(spare[0, 0], 20.0, atol=1e-6)
    np.testing.assert_allclose(spare[0, 1], 18.0, atol=1e-6)
    assert are_kept(limits(), turned([1, 0, 0], 29.9))[0]
    assert not are_kept(limits(), turned([1, 0, 0], 30.1))[0]
    assert not are_kept(limits(), turned([1, 0, 0], 29.9), np.radians(0.2))[0]


def test_a_turn_about_vertical_legs_turns_no_joint():
    np.testing.assert_allclose(np.degrees(limits().spare_angles(turned([0, 0, 1], 80.0)))[0, 1], 30.0)


def test_legs_that_come_too_near_are_seen():
    apart = turned([1, 0, 0], 0.0).smallest_distance()[0]
    assert apart == pytest.approx(2 * 50.0 * np.sin(0.5), abs=1.0)
    assert are_kept(limits(distance=apart - 0.1), turned([1, 0, 0], 0.0))[0]
    assert not are_kept(limits(distance=apart + 0.1), turned([1, 0, 0], 0.0))[0]
    assert not are_kept(limits(distance=apart - 0.1), turned([1, 0, 0], 0.0), np.append(np.zeros(12), 0.2))[
        0
    ]


@pytest.mark.parametrize("missing", [25.0, 30.0, 31.0, 500.0])
def test_limits_that_include_legs_that_touch_still_have_a_margin_for_their_distance(missing):
    # One robot in 1,700 stood so under its provisional geometry, and its run ended with a traceback.
    here = turned([1, 0, 0], 10.0)
    stated = limits(distance=30.0)
    spare = stated.margins(here)[0, 12]
    wanted = np.append(np.zeros(12), spare + missing)
    widened = stated.including(stated.margins(here)[0], wanted)
    assert widened.margins(here).shape == (1, 13)
    assert (widened.margins(here)[0] >= wanted).all()
    assert len(widened.margins_for(0.1, 100.0)) == 13


def test_limits_that_include_a_pose_allow_it_and_nothing_beyond():
    here = turned([1, 0, 0], 33.0)
    stated = limits(distance=60.0)
    widened = stated.including(stated.margins(here)[0])
    assert are_kept(widened, here)[0]
    assert are_kept(widened, turned([1, 0, 0], 10.0))[0]
    assert not are_kept(widened, turned([1, 0, 0], 33.1))[0]
    np.testing.assert_allclose(np.degrees(widened.base_cones), 20.0)


@pytest.mark.parametrize("distance", [0.0, 40.0])
@pytest.mark.parametrize(
    "wanted", [0.0, 0.05, np.linspace(0.2, 0.0, 13)], ids=["none", "one", "each its own"]
)
def test_limits_are_kept_where_no_margin_is_less_than_wanted(distance, wanted):
    random = np.random.default_rng(3)
    some = [turned(random.normal(size=3), angle) for angle in random.uniform(0.0, 25.0, 40)]
    base, platform, rotations = (
        np.concatenate([getattr(legs, name) for legs in some])
        for name in ("base_joints", "platform_joints", "rotations")
    )
    legs = Legs(base + random.normal(scale=40.0, size=base.shape), platform, rotations)
    wanted = wanted if np.isscalar(wanted) else wanted[: 12 + (distance > 0.0)]
    kept = limits(distance=distance).keeps(legs, wanted)
    np.testing.assert_array_equal(kept, are_kept(limits(distance=distance), legs, wanted))
    assert kept.any()
    assert not kept.all()
