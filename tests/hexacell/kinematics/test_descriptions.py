"""Parameters have one order, name and unit everywhere; poses are the same alone and as arrays."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexacell.cell.by_mechanism import tolerance_settings
from hexacell.config.toml_format import native_layout
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
from hexacell.kinematics.parameters import ParameterKind, ParameterSet, ParameterUnit
from hexacell.kinematics.pose import Pose, PoseBatch
from tests.geometries import hexaglide_geometry

COUNTING = np.arange(42.0)


def test_the_order_of_the_vector_is_that_of_the_names():
    geometry = Geometry(HEXAGLIDE_PARAMETERS, COUNTING)
    for name, value in zip(HEXAGLIDE_PARAMETERS.names, COUNTING, strict=True):
        leg = int(name[1]) - 1
        entry = geometry["l"][leg] if name[0] == "l" else geometry[name[0]][leg, "xyz".index(name[2])]
        assert entry == value, name
    np.testing.assert_array_equal(geometry.vector, COUNTING)


def test_arrays_are_read_only_copies():
    S = np.zeros((6, 3))
    geometry = hexaglide_geometry(S, np.zeros((6, 3)), np.ones(6))
    S[0, 0] = 1.0
    assert geometry["S"][0, 0] == 0.0
    for array in (geometry["S"], geometry["B"], geometry["l"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0
    with pytest.raises(ValueError, match="read-only"):
        geometry.vector[0] = 5.0


def test_a_wrong_shape_is_refused_by_name():
    with pytest.raises(ValueError, match=r"^B has the shape"):
        hexaglide_geometry(np.zeros((6, 3)), np.zeros((5, 3)), np.ones(6))


def test_differences_and_the_way_between_two_geometries(paper):
    assert paper.nominal.largest_difference(paper.actual) == pytest.approx(6.059)  # l1, Table 2
    assert paper.actual.largest_difference(paper.nominal) == pytest.approx(6.059)
    np.testing.assert_array_equal(
        paper.actual.interpolate_from(paper.nominal, 0.0).vector, paper.nominal.vector
    )
    np.testing.assert_array_equal(
        paper.actual.interpolate_from(paper.nominal, 1.0).vector, paper.actual.vector
    )
    quarter = paper.actual.interpolate_from(paper.nominal, 0.25)
    assert quarter["l"][0] == pytest.approx(590 - 0.25 * 6.059)


RAILS = ParameterSet(
    (
        ParameterKind("r", ("a", "b"), "rail directions, rad", "every rail", unit=ParameterUnit.RAD),
        ParameterKind("l", (), "leg lengths, mm", "every leg", default_tolerance=7.0, is_positive=True),
    )
)
"""Another number of parameters a leg, in two units."""


def test_a_unit_has_its_own_decimals_and_no_tolerance_by_default(tmp_path: Path) -> None:
    drawn = Geometry.of(RAILS, {"r": np.zeros((6, 2)), "l": np.full(6, 600.0)})
    built = Geometry.of(RAILS, {"r": np.full((6, 2), 1.23456e-6), "l": np.full(6, 600.1234561)})
    config = tmp_path / "robot.toml"
    lines = [f"{symbol} = {values}" for symbol, values in drawn.document().items()]
    config.write_text("\n".join(["[geometry]", *lines, "branch = [1, 1, 1, 1, 1, 1]", ""]))
    config.write_text(native_layout(RAILS).rewrite([config.read_text()], built)[0])
    read = native_layout(RAILS).read(config).geometry
    assert read["r"][2, 1] == 1.235e-6
    assert read["l"][0] == 600.123456
    assert tolerance_settings(RAILS).model_fields["r_rad"].is_required()
    assert not tolerance_settings(RAILS).model_fields["l_mm"].is_required()


def test_vectors_arrays_and_documents_have_consistent_order() -> None:
    numbers = np.arange(len(RAILS), dtype=float)
    assert len(RAILS) == 18
    assert RAILS.names[:3] == ("r1a", "r1b", "r2a")
    np.testing.assert_array_equal(RAILS.array(numbers, "l"), numbers[12:])
    np.testing.assert_array_equal(RAILS.vector(RAILS.document(numbers)), numbers)
    of_legs = np.array([[f"r{leg}a", f"r{leg}b", f"l{leg}"] for leg in range(1, 7)]).ravel()
    assert tuple(of_legs[RAILS.first_places]) == RAILS.names
    assert RAILS.places == tuple(enumerate(RAILS.first_places.tolist()))
    every_leg = RAILS.of_every_row(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(every_leg[[0, 1, 2, 12]], [1, 2, 1, 3])


def test_what_legs_share_has_a_place_in_the_derivatives_of_each() -> None:
    """Two halves of a platform hold two legs each; a passive constraint has one number of its own."""
    own = ParameterKind("l", (), "lengths", "every length", owners=((0,), (1,), (2,), (3,)))
    half = ParameterKind("h", ("x", "y"), "halves", "both", owners=((0, 1), (2, 3)))
    skew = ParameterKind("s", (), "angle", "it", owners=((4,),))
    shared = ParameterSet((own, half, skew))
    assert shared.names == ("l1", "l2", "l3", "l4", "h1x", "h1y", "h2x", "h2y", "s1")
    assert (shared.legs, shared.columns) == (4, 3)
    by_constraint = shared.by_constraint(np.arange(1.0, 10.0))
    expected = [[1, 5, 6], [2, 5, 6], [3, 7, 8], [4, 7, 8], [9, 0, 0], [0, 0, 0]]
    np.testing.assert_array_equal(by_constraint, expected)
    assert shared.first_places.tolist() == [0, 3, 6, 9, 1, 2, 7, 8, 12]
    further = set(shared.places) - set(enumerate(shared.first_places.tolist()))
    assert further == {(4, 4), (5, 5), (6, 10), (7, 11)}


def test_the_balls_offset_needs_coordinates() -> None:
    with pytest.raises(ValueError, match="x, y, z"):
        ParameterKind("B", ("u", "v"), "joints", "every joint", has_ball_offset=True)


length = st.floats(-1e3, 1e3)
angle = st.floats(-89.0, 89.0)
poses = st.builds(Pose, length, length, length, angle, angle, angle)


@given(poses)
def test_a_pose_converted_to_a_matrix_and_back_is_unchanged(pose):
    back = Pose.of(pose.position, pose.rotation)
    np.testing.assert_allclose(back.as_tuple(), pose.as_tuple(), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        (slice(1, None), [1, 2]),
        ([2, 0], [2, 0]),
        (np.array([True, False, True]), [0, 2]),
        (np.array([1]), [1]),
    ],
)
def test_rows_are_taken_from_positions_and_rotations_alike(rows, expected):
    all_of_them = [Pose(0, 0, 1, 10), Pose(0, 0, 2, 20), Pose(0, 0, 3, 30)]
    taken = PoseBatch.of(all_of_them)[rows]
    assert [taken.pose(row).z for row in range(len(taken))] == [all_of_them[n].z for n in expected]
    assert [round(taken.pose(row).a) for row in range(len(taken))] == [all_of_them[n].a for n in expected]


def test_tilt_is_between_the_z_axes_and_poses_that_differ_by_rounding_are_the_same() -> None:
    tilts = PoseBatch.of(
        [Pose(0, 0, 0), Pose(0, 0, 0, 30, 0, 70), Pose(0, 0, 0, 0, -40), Pose(0, 0, 0, 60, 60)]
    )
    np.testing.assert_allclose(
        np.degrees(tilts.tilts()), [0.0, 30.0, 40.0, np.degrees(np.arccos(0.25))], atol=1e-6
    )
    poses = PoseBatch.of(
        [Pose(1, 2, 3, 4, 5, 180), Pose(1, 2, 3 + 1e-9, 4, 5, -180), Pose(1, 2, 3, 4, 5, 179.99)]
    )
    assert poses.is_same(poses[:1]).tolist() == [True, True, False]
