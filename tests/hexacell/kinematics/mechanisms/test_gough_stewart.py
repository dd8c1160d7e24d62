"""The Gough-Stewart platform's leg equation, its frames, and the words that it has for them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.errors import UsageError
from hexacell.kinematics.mechanisms.gough_stewart import (
    GOUGH_STEWART_PARAMETERS,
    THREE_LEGS_FRAME,
    GoughStewart,
)
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.geometries import gough_stewart_geometry

STEP = 1e-30  # complex steps need no compromise between rounding and truncation
MECHANISM = GoughStewart()
degrees = st.floats(-40.0, 40.0)
poses = st.builds(
    Pose, st.floats(-200, 200), st.floats(-200, 200), st.floats(600, 900), degrees, degrees, degrees
)


def machine(seed: int = 5) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    base, platform = (
        np.array([[r * np.cos(a), r * np.sin(a), z] for a in np.radians(angles)])
        + random.uniform(-3.0, 3.0, (6, 3))
        for r, z, angles in (
            (500, 0, (198, 222, 318, 342, 78, 102)),
            (200, -80, (165, 255, 285, 15, 45, 135)),
        )
    )
    return {"base": base, "platform": platform, "offset": random.uniform(-20.0, 600.0, 6)}


def leg_errors(base, platform, offset, joints, position, turn, rotation):
    """Length of each leg less what its encoder says, of complex numbers."""
    x, y, z = turn
    small_turn = np.eye(3) + np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    leg = position + platform @ (small_turn @ rotation).T - base
    return np.sqrt(np.sum(leg * leg, axis=1)) - offset - joints


def by_complex_step(numbers, name, place):
    stepped = {key: np.asarray(value, dtype=complex).copy() for key, value in numbers.items()}
    stepped[name][place] += 1j * STEP
    return leg_errors(**stepped).imag / STEP


@given(poses, st.floats(-5.0, 5.0))
def test_derivatives_are_those_of_the_leg_equation(pose: Pose, off_mm: float) -> None:
    """Also where the legs do not close: the solver linearizes there."""
    numbers, batch = machine(), PoseBatch.of([pose])
    geometry = gough_stewart_geometry(**numbers)
    joints = MECHANISM.inverse(geometry, (), batch) + off_mm
    state = {**numbers, "joints": joints[0], "position": pose.position, "turn": np.zeros(3)}
    state["rotation"] = pose.rotation
    found = MECHANISM.derivatives(geometry, batch, joints)
    residual, jacobian = MECHANISM.residual_and_jacobian(geometry, batch, joints)
    np.testing.assert_allclose(residual[0], leg_errors(**state), atol=1e-11)
    np.testing.assert_allclose(residual[0], -off_mm, atol=1e-11)
    np.testing.assert_array_equal(jacobian, found.pose)
    for axis in range(3):
        by_position = by_complex_step(state, "position", (axis,))
        np.testing.assert_allclose(found.pose[0, :, axis], by_position, atol=1e-12)
        by_turn = by_complex_step(state, "turn", (axis,))
        np.testing.assert_allclose(found.pose[0, :, 3 + axis], by_turn, atol=1e-10)
    for leg in range(6):
        places = [("base", (leg, axis)) for axis in range(3)]
        places += [("platform", (leg, axis)) for axis in range(3)]
        expected = [
            by_complex_step(state, name, place)[leg] for name, place in [*places, ("offset", (leg,))]
        ]
        np.testing.assert_allclose(found.parameters[0, leg], expected, atol=1e-12)
        assert found.joints[0, leg] == by_complex_step(state, "joints", (leg,))[leg]


def test_offsets_of_zero_are_whole_lengths() -> None:
    """As LinuxCNC's genhexkins has it."""
    numbers = machine() | {"offset": np.zeros(6)}
    pose = Pose(20.0, -30.0, 700.0, 5.0, -10.0, 15.0)
    ends = pose.position + numbers["platform"] @ pose.rotation.T
    lengths = [np.linalg.norm(end - joint) for end, joint in zip(ends, numbers["base"], strict=True)]
    geometry = gough_stewart_geometry(**numbers)
    np.testing.assert_allclose(MECHANISM.inverse(geometry, (), PoseBatch.of([pose]))[0], lengths)


def test_33_of_42_parameters_are_free() -> None:
    assert len(GOUGH_STEWART_PARAMETERS) == 42
    assert len(THREE_LEGS_FRAME.free_names) == 33
    assert not GOUGH_STEWART_PARAMETERS.has_branch


def test_the_frames_are_those_of_legs_1_3_and_5() -> None:
    normal, _ = MECHANISM.normalize_frames(gough_stewart_geometry(**machine()))
    base, platform = normal["base"], normal["platform"]
    np.testing.assert_array_equal(base[0], 0.0)
    np.testing.assert_array_equal(base[2, 1:], 0.0)
    assert base[2, 0] > 0.0
    assert base[4, 1] > 0.0
    assert base[4, 2] == 0.0
    assert platform[0, 2] == platform[2, 2] == platform[4, 2]
    assert platform[0, 1] == platform[2, 1] < platform[4, 1]


@pytest.mark.parametrize(
    ("part", "legs", "problem"),
    [
        ("base", (0, 2), "two base joints that fix the frame are at one place"),
        ("platform", (2, 4), "the platform joints that fix the frame are in one line"),
        ("platform", (0, 2), "two platform joints that fix the frame are at one place"),
    ],
)
def test_joints_that_fix_no_frame_are_refused(part: str, legs: tuple[int, int], problem: str) -> None:
    numbers = machine()
    numbers[part][legs[1]] = numbers[part][legs[0]]
    with pytest.raises(UsageError, match=problem):
        MECHANISM.normalize_frames(gough_stewart_geometry(**numbers))


def test_parameters_in_words() -> None:
    name = THREE_LEGS_FRAME.display_name
    assert name("offset4") == "leg 4 offset"
    assert name("platform1z") == "platform1/platform3/platform5 z"
    assert name("base6y") == "base6 y"


def test_every_part_of_it_expands() -> None:
    assert {kind.part for kind in GOUGH_STEWART_PARAMETERS.kinds} == set(MachinePart)
