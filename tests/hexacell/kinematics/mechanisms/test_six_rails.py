"""Rails of any direction: the leg equation, directions in two numbers, frames, the Hexaglide among them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.errors import UsageError
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.mechanisms.hexaglide import Hexaglide
from hexacell.kinematics.mechanisms.six_rails import (
    FIRST_RAIL_FRAME,
    SIX_RAILS_PARAMETERS,
    SixRails,
)
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import TurnedAxes, turns_of
from tests.geometries import six_rails_geometry

STEP = 1e-30  # complex steps need no compromise between rounding and truncation
MECHANISM = SixRails()
UP: Branch = (1, 1, 1, 1, 1, 1)
degrees = st.floats(-25.0, 25.0)
poses = st.builds(
    Pose, st.floats(-100, 100), st.floats(-100, 100), st.floats(200, 500), degrees, degrees, degrees
)
turns = st.floats(-2.0, 2.0)


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


def leg_errors(S, rail, B, l, joints, position, turn, rotation):  # noqa: E741
    """Distance of each leg's joints less its length, of complex numbers."""
    x, y, z = turn
    small_turn = np.eye(3) + np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.sqrt(rail[:, 0] ** 2 + rail[:, 1] ** 2)
    sine = np.sin(angle) / angle
    direction = np.stack([rail[:, 1] * sine, -rail[:, 0] * sine, np.cos(angle)], axis=1)
    leg = S + joints[:, None] * direction - position - B @ (small_turn @ rotation).T
    return np.sqrt(np.sum(leg * leg, axis=1)) - l


def by_complex_step(numbers, name, place):
    stepped = {key: np.asarray(value, dtype=complex).copy() for key, value in numbers.items()}
    stepped[name][place] += 1j * STEP
    return leg_errors(**stepped).imag / STEP


@given(poses, st.floats(-5.0, 5.0))
def test_derivatives_are_those_of_the_leg_equation(pose: Pose, off_mm: float) -> None:
    """Also where the legs do not close: the solver linearizes there."""
    numbers, batch = machine(), PoseBatch.of([pose])
    geometry = six_rails_geometry(**numbers)
    joints = MECHANISM.inverse(geometry, UP, batch) + off_mm
    state = {**numbers, "joints": joints[0], "position": pose.position, "turn": np.zeros(3)}
    state["rotation"] = pose.rotation
    found = MECHANISM.derivatives(geometry, batch, joints)
    residual, jacobian = MECHANISM.residual_and_jacobian(geometry, batch, joints)
    np.testing.assert_allclose(residual[0], leg_errors(**state), atol=1e-11)
    np.testing.assert_allclose(jacobian, found.pose, atol=1e-12)
    for axis in range(3):
        by_position = by_complex_step(state, "position", (axis,))
        np.testing.assert_allclose(found.pose[0, :, axis], by_position, atol=1e-12)
        by_turn = by_complex_step(state, "turn", (axis,))
        np.testing.assert_allclose(found.pose[0, :, 3 + axis], by_turn, atol=1e-10)
    for leg in range(6):
        places: list[tuple[str, tuple[int, ...]]] = [("S", (leg, axis)) for axis in range(3)]
        places += [("rail", (leg, axis)) for axis in range(2)]
        places += [("B", (leg, axis)) for axis in range(3)] + [("l", (leg,))]
        expected = [by_complex_step(state, name, place)[leg] for name, place in places]
        np.testing.assert_allclose(found.parameters[0, leg], expected, rtol=1e-11, atol=1e-11)
        own = by_complex_step(state, "joints", (leg,))[leg]
        assert found.joints[0, leg] == pytest.approx(own, abs=1e-12)


def directions_of_rails(turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    axes = TurnedAxes.by(turns)
    return axes.axis, axes.by_turns[2]


@given(turns, turns)
def test_a_direction_is_where_the_turn_puts_the_z_axis(a: float, b: float) -> None:
    direction, by_turns = directions_of_rails(np.array([a, b]))
    turned = Rotation.from_rotvec([a, b, 0.0]).as_matrix()[:, 2]
    np.testing.assert_allclose(direction, turned, atol=1e-12)
    for column, step in enumerate(1e-6 * np.eye(2)):
        ends = [directions_of_rails(np.array([a, b]) + side * step)[0] for side in (1.0, -1.0)]
        np.testing.assert_allclose(by_turns[:, column], (ends[0] - ends[1]) / 2e-6, atol=1e-8)


@given(turns, turns)
def test_turns_are_found_from_directions(a: float, b: float) -> None:
    direction, _ = directions_of_rails(np.array([a, b]))
    np.testing.assert_allclose(turns_of(direction), [a, b], atol=1e-9)


@pytest.mark.parametrize(
    ("turn", "axis"),
    [((0, 0), (0, 0, 1)), ((0, np.pi / 2), (1, 0, 0)), ((-np.pi / 2, 0), (0, 1, 0))],
    ids=["vertical", "along x", "along y"],
)
def test_directions_along_the_axes(turn, axis) -> None:
    np.testing.assert_allclose(directions_of_rails(np.array(turn, dtype=float))[0], axis, atol=1e-15)


@given(
    st.builds(Pose, st.floats(-50, 50), st.floats(-100, 50), st.floats(500, 580), degrees, degrees, degrees)
)
def test_a_hexaglide_is_its_special_case(hexaglide: Hexaglide, paper, pose: Pose) -> None:
    """Rails along x: the same joint variables, and the same derivatives by the numbers of both."""
    values, batch = paper.actual.document(), PoseBatch.of([pose])
    geometry = six_rails_geometry(values["S"], np.tile([0.0, np.pi / 2], (6, 1)), values["B"], values["l"])
    joints = hexaglide.inverse(paper.actual, paper.branch, batch)
    np.testing.assert_allclose(MECHANISM.inverse(geometry, paper.branch, batch), joints, atol=1e-9)
    if np.isnan(joints).any():
        return
    theirs = hexaglide.derivatives(paper.actual, batch, joints)
    ours = MECHANISM.derivatives(geometry, batch, joints)
    np.testing.assert_allclose(ours.pose, theirs.pose, atol=1e-9)
    np.testing.assert_allclose(ours.joints, theirs.joints, atol=1e-12)
    np.testing.assert_allclose(np.delete(ours.parameters, [3, 4], axis=-1), theirs.parameters, atol=1e-12)
    np.testing.assert_array_equal(MECHANISM.branch(geometry, batch, joints), [paper.branch])


def test_a_pose_out_of_reach_is_nan() -> None:
    batch = PoseBatch.of([Pose(2000.0, 0.0, 300.0)])
    assert np.isnan(MECHANISM.inverse(six_rails_geometry(**machine()), UP, batch)).any()


def test_45_of_54_parameters_are_free() -> None:
    assert len(SIX_RAILS_PARAMETERS) == 54
    assert len(FIRST_RAIL_FRAME.free_names) == 45


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
