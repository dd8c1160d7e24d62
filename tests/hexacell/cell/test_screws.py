"""Section ``[robot.screws]``: legs that are screws."""

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.errors import FileError
from hexacell.kinematics.mechanisms.encoder_scales import WithEncoderScales
from hexacell.kinematics.mechanisms.gough_stewart import ScrewLegs
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot.model import robot_of

SCREWS = f"""
[robot.screws]
lead_mm = 5.0
base_axes = {[[1.0, 0.5 * leg, 0.0] for leg in range(6)]}
platform_axes = {[[0.2 * leg, 1.0, 0.0] for leg in range(6)]}
"""
SCALES = (
    ("[robot]\n", "[robot]\nencoder_scales = true\n"),
    ("[tolerances]\n", "[tolerances]\nencoder_scale = 1e-3\n"),
)


def test_its_robot_has_legs_that_the_screws_correct(copied) -> None:
    with_screws, without = (
        robot_of(load_cell(copied("gough-stewart", more=text))) for text in (SCREWS, "")
    )
    pose = PoseBatch.of([Pose(0.0, 0.0, 780.0, 10.0, 5.0, 15.0)])
    assert isinstance(with_screws.mechanism, ScrewLegs)
    added = with_screws.mechanism.inverse(with_screws.drawing, (), pose) - without.mechanism.inverse(
        without.drawing, (), pose
    )
    assert 0.01 < np.abs(added).max() < 5.0 / 4.0


def test_errors_of_scale_go_with_them(copied) -> None:
    mechanism = load_cell(copied("gough-stewart", *SCALES, more=SCREWS)).settings.mechanism
    assert isinstance(mechanism, WithEncoderScales)
    assert isinstance(mechanism.exact, ScrewLegs)


def test_a_mechanism_without_such_legs_refuses_them(copied) -> None:
    with pytest.raises(FileError, match="the legs of hexaglide are no screws"):
        load_cell(copied("simulated-hexaglide", more=SCREWS))


def test_an_axis_without_a_direction_is_refused_by_its_line(copied) -> None:
    wrong = SCREWS.replace("[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]", 1)
    with pytest.raises(FileError, match=r"cell\.toml:\d+: .*length zero is no direction"):
        load_cell(copied("gough-stewart", more=wrong))
