"""The frame convention: 35 free parameters of 42 numbers, for a geometry in any frames."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.pose import FrameTransform, PoseBatch

CONVENTION_MM = 1e-9
place = st.floats(-500.0, 500.0)
turn = st.floats(-np.pi, np.pi)


@st.composite
def frame_changes(draw):
    """Everything that leaves a Hexaglide itself alone: its rails stay along x."""
    return FrameTransform(
        base=Rotation.from_rotvec([draw(turn), 0.0, 0.0]).as_matrix(),
        origin=np.array(draw(st.tuples(place, place, place))),
        platform=Rotation.from_rotvec(draw(st.tuples(turn, turn, turn))).as_matrix(),
    )


@st.composite
def geometries(draw):
    """Machines near the paper's, in frames of no convention."""
    numbers = st.lists(st.floats(-7.0, 7.0), min_size=42, max_size=42)
    return np.array(draw(numbers))


def obeys_the_rules(geometry: Geometry) -> bool:
    S, B = geometry["S"], geometry["B"]
    zeros = [*S[1], S[2, 2]]
    equals = [B[1, 2] - B[2, 2], B[1, 2] - B[4, 2], B[1, 1] - B[4, 1]]
    return not np.any(zeros) and not np.any(equals)


def test_the_papers_tables_obey_the_convention(hexaglide, paper):
    for geometry in (paper.nominal, paper.actual, paper.calibrated):
        assert obeys_the_rules(geometry)
        same, _ = hexaglide.normalize_frames(geometry)
        np.testing.assert_allclose(same.vector, geometry.vector, atol=CONVENTION_MM)


@given(geometries())
def test_every_geometry_can_be_brought_to_the_convention(hexaglide, paper, errors):
    free_form = Geometry(HEXAGLIDE_PARAMETERS, paper.nominal.vector + errors)
    found, change = hexaglide.normalize_frames(free_form)
    assert obeys_the_rules(found)
    assert found["S"][2, 1] > 0.0
    assert found["B"][4, 0] > found["B"][1, 0]
    np.testing.assert_allclose(
        hexaglide.change_frames(free_form, change).vector, found.vector, atol=CONVENTION_MM
    )
    # A change of frames is a motion along the rails' axes and a rotation of the platform's.
    for matrix in (change.base, change.platform):
        np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(matrix) == pytest.approx(1.0)
    np.testing.assert_allclose(change.base[0], [1, 0, 0], atol=1e-15)


@given(frame_changes())
def test_differences_of_ball_positions_rotate_with_the_base_and_do_not_depend_on_the_origin(change):
    positions = np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, 6.5], [0.0, 0.1, -7.0]])
    moved = change.poses(PoseBatch(positions, np.broadcast_to(np.eye(3), (3, 3, 3)))).positions
    np.testing.assert_allclose(
        change.deviations(positions - positions[0]), moved - moved[0], atol=CONVENTION_MM
    )


def test_the_basis_spreads_free_parameters_over_all(hexaglide):
    basis, free = hexaglide.convention.basis, hexaglide.convention.free_names
    assert basis.shape == (42, 35)
    geometry = Geometry(HEXAGLIDE_PARAMETERS, basis @ np.arange(1.0, 36.0))
    assert obeys_the_rules(geometry)
    np.testing.assert_array_equal(hexaglide.convention.free_parameters(geometry), np.arange(1.0, 36.0))
    for column, name in enumerate(free):
        stands_for = {HEXAGLIDE_PARAMETERS.names[row] for row in np.flatnonzero(basis[:, column])}
        expected = {"B2z": {"B2z", "B3z", "B5z"}, "B2y": {"B2y", "B5y"}}.get(name, {name})
        assert stands_for == expected


@given(frame_changes(), frame_changes())
def test_two_changes_of_frames_are_one(first, second):
    poses = PoseBatch.at([10.0, -50.0, 540.0], Rotation.from_rotvec([[0.2, -0.1, 0.3]]).as_matrix())
    one, by_one = first.then(second).poses(poses), second.poses(first.poses(poses))
    np.testing.assert_allclose(one.positions, by_one.positions, atol=CONVENTION_MM)
    np.testing.assert_allclose(one.rotations, by_one.rotations, atol=1e-12)
