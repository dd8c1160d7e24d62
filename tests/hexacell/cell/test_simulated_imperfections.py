"""Keys of screws and of a simulated cell, one number for six or one each: used, or refused by line."""

import numpy as np
import pytest

from hexacell.cell.loader import load_cell
from hexacell.errors import FileError
from hexacell.kinematics.mechanisms.encoder_scales import WithEncoderScales
from hexacell.kinematics.mechanisms.gough_stewart import ScrewLegs
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.robot.model import robot_of

LEGS = "[simulation.legs]\nplay_mm = 0.1\n"
LOAD = "[simulation.load]\nweight_n = 80\n"


def test_a_cell_has_none_unless_it_says_so(load_with) -> None:
    simulation = load_with("").settings.simulation
    assert (
        simulation.joints.backlash
        == simulation.legs.play_mm
        == simulation.legs.compliance_um_n
        == (0.0,) * 6
    )
    assert simulation.load.weight_n == simulation.temperature.rise_k == 0.0


def test_one_number_is_that_of_all_six_and_six_are_of_one_each(load_with) -> None:
    six = "compliance_um_n = [0.1, 0.2, 0.3, 0.4, 0.5, 0]\n"
    simulation = load_with(
        f"{LEGS}{six}{LOAD}[simulation.joints]\nbacklash_mm = 0.02\n"
    ).settings.simulation
    assert simulation.legs.play_mm == (0.1,) * 6
    assert simulation.legs.compliance_um_n == (0.1, 0.2, 0.3, 0.4, 0.5, 0.0)
    assert simulation.joints.backlash == (0.02,) * 6


def test_backlash_of_joints_that_turn_is_in_deg(copied) -> None:
    cell = load_cell(copied("rotary-cranks", more="\n[simulation.joints]\nbacklash_deg = 0.01\n"))
    assert cell.settings.simulation is not None
    assert cell.settings.simulation.joints.backlash == (0.01,) * 6


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (LEGS, "act under a weight, and there is none. Write weight_n into"),
        ("[simulation.joints]\nbacklash_mm = -0.1", "must be 0 or more"),
        ("[simulation.joints]\nbacklash_mm = [0.1, 0.1, 0.1]", "must be a list of 6 items"),
        ("[simulation.joints]\nbacklash_mm = [0.1, 0.1, 0.1, 0.1, 0.1, -0.1]", "must be 0 or more"),
        ('[simulation.joints]\nbacklash_mm = "0.1"', "must be a list of 6 items"),
        ("[simulation.joints]\nbacklash_deg = 0.1", "unknown key 'backlash_deg'"),
        ("[simulation.load]\ndirection = [0, 0, 0]", "length zero is no direction"),
        ("[simulation.temperature]\nover_s = 0", "more than 0"),
    ],
)
def test_mistakes_of_a_simulated_cell_are_named_with_their_line(
    refusal, cell_text, more: str, words: str
) -> None:
    refusal(f"{cell_text}\n{more}\n", words, cell_text.count("\n[simulation]"))


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


def test_a_mechanism_without_such_legs_or_an_axis_without_direction_is_refused(copied) -> None:
    with pytest.raises(FileError, match="the legs of hexaglide are no screws"):
        load_cell(copied("simulated-hexaglide", more=SCREWS))
    wrong = SCREWS.replace("[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]", 1)
    with pytest.raises(FileError, match=r"cell\.toml:\d+: .*length zero is no direction"):
        load_cell(copied("gough-stewart", more=wrong))
