"""The Hexaglide and rails of any direction: leg equations, inverse kinematics, frames."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.errors import ExitCode, ReachError, UsageError
from hexacell.kinematics.mechanism import Branch, inverse_kinematics
from hexacell.kinematics.mechanisms.six_rails import SixRails
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import TurnedAxes, turns_of
from tests.geometries import hexaglide_geometry, six_rails_geometry
from tests.hexacell.conftest import vector
from tests.hexacell.kinematics.numeric import POSES

BRANCHES = list(product((-1, 1), repeat=6))


@given(POSES)
def test_inverse_is_the_closed_form(hexaglide, paper, legs, pose):
    expected = legs(paper.actual).joints(vector(pose))
    found = hexaglide.inverse(paper.actual, paper.branch, PoseBatch.of([pose]))[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)  # NaN where NaN is expected


@given(POSES, st.sampled_from(BRANCHES))
def test_every_branch_closes_the_legs_and_is_recognised(hexaglide, paper, pose, branch):
    at = PoseBatch.of([pose])
    joints = hexaglide.inverse(paper.nominal, branch, at)
    if np.isnan(joints).any():
        return
    np.testing.assert_allclose(
        hexaglide.residual_and_jacobian(paper.nominal, at, joints)[0], 0.0, atol=1e-10
    )
    np.testing.assert_array_equal(hexaglide.branch(paper.nominal, at, joints), [branch])


def test_inverse_agrees_with_linuxcnc(hexaglide, paper):
    """LinuxCNC 2.9 running a hexaglide kinematics module of its own, docs/linuxcnc.md."""
    joints = inverse_kinematics(
        hexaglide, paper.nominal, paper.branch, PoseBatch.of([Pose(10, 20, 560, 5, -4, 3)])
    )
    expected = [-461.827519, -455.741652, -448.908104, 465.952312, 465.044723, 488.923462]
    np.testing.assert_allclose(joints, [expected], atol=6e-7)


def test_a_pose_out_of_reach_names_the_leg_and_the_pose(hexaglide, paper):
    lengths = paper.nominal["l"].copy()
    lengths[3] = 400.0
    short_leg_4 = hexaglide_geometry(paper.nominal["S"], paper.nominal["B"], lengths)
    poses = PoseBatch.of([Pose(0, 0, 500), Pose(0, 0, 550), Pose(0, 0, 560, 1)])
    missing = np.isnan(hexaglide.inverse(short_leg_4, paper.branch, poses))
    np.testing.assert_array_equal(missing, [[0] * 6, [0, 0, 0, 1, 0, 0], [0, 0, 0, 1, 0, 0]])
    with pytest.raises(ReachError, match=r"^leg 4 cannot .* X0\.000 Y0\.000 Z550\.000 ") as caught:
        inverse_kinematics(hexaglide, short_leg_4, paper.branch, poses)
    assert caught.value.exit_code is ExitCode.USAGE


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


def test_rail_1_and_slider_3_are_the_base_frame_unless_rails_oppose_or_coincide() -> None:
    normal, _ = MECHANISM.normalize_frames(six_rails_geometry(**machine()))
    np.testing.assert_array_equal(normal["S"][0], 0.0)
    np.testing.assert_array_equal(normal["rail"][0], 0.0)
    assert normal["S"][2, 1] == 0.0 < normal["S"][2, 0]
    numbers = machine()
    numbers["rail"][4] = turns_of(-directions_of_rails(numbers["rail"][0])[0])
    with pytest.raises(UsageError, match="a slider counts the opposite way of slider 1"):
        MECHANISM.normalize_frames(six_rails_geometry(**numbers))
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
