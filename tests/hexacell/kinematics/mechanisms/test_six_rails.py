"""Rails of any direction: the leg equation, directions in two numbers, frames, the Hexaglide among them."""

import numpy as np
import pytest

from hexacell.errors import UsageError
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.mechanisms.six_rails import SixRails
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import TurnedAxes, turns_of
from tests.geometries import six_rails_geometry

MECHANISM = SixRails()
UP: Branch = (1, 1, 1, 1, 1, 1)


def machine(seed: int = 3) -> dict[str, np.ndarray]:
    """Slanted rails, no two of one direction."""
    random = np.random.default_rng(seed)
    S, B = (
        np.array([[r * np.cos(a), r * np.sin(a), z] for a in np.radians(angles)])
        + random.uniform(-3.0, 3.0, (6, 3))
        for r, z, angles in (
            (600, 0, (200, 220, 320, 340, 80, 100)),
            (180, -60, (165, 255, 285, 15, 45, 135)),
        )
    )
    l = 800.0 + random.uniform(-3.0, 3.0, 6)  # noqa: E741 - the paper's symbol
    return {"S": S, "rail": random.uniform(-0.2, 0.2, (6, 2)), "B": B, "l": l}


def directions_of_rails(turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    axes = TurnedAxes.by(turns)
    return axes.axis, axes.by_turns[2]


def test_rail_1_and_slider_3_are_the_base_frame() -> None:
    normal, _ = MECHANISM.normalize_frames(six_rails_geometry(**machine()))
    np.testing.assert_array_equal(normal["S"][0], 0.0)
    np.testing.assert_array_equal(normal["rail"][0], 0.0)
    assert normal["S"][2, 1] == 0.0 < normal["S"][2, 0]


def test_rails_that_count_the_opposite_way_are_refused() -> None:
    numbers = machine()
    numbers["rail"][4] = turns_of(-directions_of_rails(numbers["rail"][0])[0])
    with pytest.raises(UsageError, match="a slider counts the opposite way of slider 1"):
        MECHANISM.normalize_frames(six_rails_geometry(**numbers))


def test_sliders_on_one_rail_fix_no_frame() -> None:
    numbers = machine()
    numbers["S"][2] = numbers["S"][0] + 100.0 * directions_of_rails(numbers["rail"][0])[0]
    with pytest.raises(UsageError, match="two slider joints that fix the frame are on one rail"):
        MECHANISM.normalize_frames(six_rails_geometry(**numbers))


def test_a_displacement_across_a_rail_is_that_of_its_joint() -> None:
    """As rails that are not straight move it."""
    geometry, batch = (
        six_rails_geometry(**machine()),
        PoseBatch.of([Pose(10.0, 20.0, 300.0, 5.0, -3.0, 8.0)]),
    )
    joints = MECHANISM.inverse(geometry, UP, batch)
    guides = MECHANISM.guides(geometry, batch, joints)
    assert guides is not None
    assert guides.rails == ((0,), (1,), (2,), (3,), (4,), (5,))
    direction, by_turns = directions_of_rails(geometry["rail"])
    sideways = by_turns / np.linalg.norm(by_turns, axis=1, keepdims=True)
    np.testing.assert_allclose(np.einsum("ij,ijk->ik", direction, sideways), 0.0, atol=1e-12)
    for side in range(2):
        ends = [
            MECHANISM.residual_and_jacobian(
                six_rails_geometry(
                    geometry["S"] + sign * 1e-4 * sideways[..., side],
                    *(geometry[symbol] for symbol in ("rail", "B", "l")),
                ),
                batch,
                joints,
            )[0]
            for sign in (1.0, -1.0)
        ]
        np.testing.assert_allclose(guides.across[..., side], (ends[0] - ends[1]) / 2e-4, atol=1e-8)
