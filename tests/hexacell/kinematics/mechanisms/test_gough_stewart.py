"""The Gough-Stewart platform's leg equation, its frames, and the words that it has for them."""

import numpy as np
import pytest

from hexacell.errors import UsageError
from hexacell.kinematics.mechanisms.gough_stewart import THREE_LEGS_FRAME, GoughStewart
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.geometries import gough_stewart_geometry

MECHANISM = GoughStewart()


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


def test_offsets_of_zero_are_whole_lengths() -> None:
    """As LinuxCNC's genhexkins has it."""
    numbers = machine() | {"offset": np.zeros(6)}
    pose = Pose(20.0, -30.0, 700.0, 5.0, -10.0, 15.0)
    ends = pose.position + numbers["platform"] @ pose.rotation.T
    lengths = [np.linalg.norm(end - joint) for end, joint in zip(ends, numbers["base"], strict=True)]
    geometry = gough_stewart_geometry(**numbers)
    np.testing.assert_allclose(MECHANISM.inverse(geometry, (), PoseBatch.of([pose]))[0], lengths)


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
