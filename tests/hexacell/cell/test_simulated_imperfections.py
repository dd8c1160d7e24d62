"""Keys of a simulated cell for what is not geometry: one number for all six joints or legs, or six."""

import pytest

from hexacell.cell.loader import load_cell

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
def test_mistakes_are_named_with_their_line(refusal, cell_text, more: str, words: str) -> None:
    refusal(f"{cell_text}\n{more}\n", words, cell_text.count("\n[simulation]"))
