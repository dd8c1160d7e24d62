"""The description of a mechanism's parameters: order, units, keys and messages."""

from pathlib import Path

import numpy as np
import pytest

from hexacell.cell.by_mechanism import tolerance_settings
from hexacell.config.toml_format import NativeToml
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import ParameterKind, ParameterSet, ParameterUnit

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
    config.write_text(NativeToml(RAILS).rewrite(config.read_text(), built))
    read = NativeToml(RAILS).read(config).geometry
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
    assert tuple(of_legs[RAILS.leg_order]) == RAILS.names
    every_leg = RAILS.of_every_leg(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(every_leg[[0, 1, 2, 12]], [1, 2, 1, 3])


def test_the_balls_offset_needs_three_coordinates() -> None:
    with pytest.raises(ValueError, match="x, y, z"):
        ParameterKind("B", ("u", "v"), "joints", "every joint", has_ball_offset=True)
