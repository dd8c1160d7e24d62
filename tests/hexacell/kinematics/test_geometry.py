"""The 42 numbers: their order, their names, and that they are read-only."""

import numpy as np
import pytest

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanisms.hexaglide import HEXAGLIDE_PARAMETERS
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
