"""Keys are in the unit of the joint variables; lengths are refused where encoders show angles."""

import re
from pathlib import Path

import pytest

from hexacell.cell.devices import RotaryEncoderSettings
from hexacell.cell.loader import describe, load_cell
from hexacell.errors import FileError
from hexacell.robot.stated import stated_effects

CONFIGS = Path(__file__).parents[3] / "configs"
JOINT_KEYS = ("joint_min", "joint_max", "encoder", "following", "spread_encoder", "repeatability", "offset")


def test_the_values_are_those_of_the_keys_in_deg() -> None:
    settings = load_cell(CONFIGS / "rotary-cranks.toml").settings
    assert (settings.limits.joint_min, settings.limits.joint_max) == (-90.0, 120.0)
    assert settings.noise.encoder == 0.002
    assert settings.speed.joint_at_gauges == 6.0
    assert isinstance(settings.encoders, RotaryEncoderSettings)
    assert settings.encoders.step == 360.0 / 2**22


def test_every_default_of_a_joint_is_told_in_deg_and_none_in_mm() -> None:
    text = describe(load_cell(CONFIGS / "rotary-cranks.toml"))
    for key in JOINT_KEYS:
        assert f"\n{key}_deg = " in text, key
        assert f"\n{key}_mm = " not in text, key
    assert "joint_deg_s" in text
    assert "joint_mm_s" not in text
    linear = describe(load_cell(CONFIGS / "gough-stewart.toml"))
    assert not [key for key in JOINT_KEYS if f"\n{key}_mm = " not in linear]


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("encoder_deg = 0.002", "encoder_mm = 0.002", "unknown key 'encoder_mm' in [noise]"),
        ("joint_min_deg = -90.0", "joint_min_mm = -90.0", "unknown key 'joint_min_mm' in [limits]"),
        ("joint_deg_s = 24.0", "joint_mm_s = 24.0", "unknown key 'joint_mm_s' in [speed]"),
        ("joint_min_deg = -90.0", "joint_min_deg = 190.0", "joint_min_deg must be below joint_max_deg"),
        ("counts_per_turn = 4194304", "measuring_step_nm = 1000", "unknown key 'measuring_step_nm'"),
        ("counts_per_turn = 4194304", "counts_per_turn = 0", "must be 1 or more"),
    ],
)
def test_keys_of_lengths_are_refused(copied, old: str, new: str, problem: str) -> None:
    with pytest.raises(FileError) as refused:
        load_cell(copied("rotary-cranks", (old, new)))
    assert problem in str(refused.value)


def test_a_length_check_is_of_encoders_of_lengths(copied) -> None:
    values = "distance_mm = 300.0\nuncertainty_mm = 0.001\nfirst_seat = [0.0, 0.0, 600.0]\n"
    section = f"[length_check]\n{values}[simulation]"
    with pytest.raises(FileError, match="those of this mechanism are of angles"):
        load_cell(copied("rotary-cranks", ("[simulation]", section)))


def test_an_inch_machine_tells_angles_in_degrees(copied) -> None:
    inches = ("[controller]\n", "[controller]\nunit_mm = 25.4\n")
    rotary = load_cell(copied("rotary-cranks", inches)).settings.controller
    assert (rotary.unit_mm, rotary.joint_unit_mm) == (25.4, 1.0)
    linear = load_cell(copied("gough-stewart", inches)).settings.controller
    assert linear.joint_unit_mm == 25.4


def test_encoders_of_angles_have_no_scale_and_are_off_centre() -> None:
    settings = load_cell(CONFIGS / "rotary-cranks.toml").settings
    names = {effect.name: effect.unit for effect in stated_effects(settings)}
    assert names["eccentricity of each encoder"] == "mdeg"
    assert names["repeatability of a crank"] == "mdeg"
    assert not [name for name in names if "scale" in name and "gauge" not in name]


FIXTURE = """[length_check]
first_seat = [-150.0, 0.0, 500.0]
distance_mm = 300.012
uncertainty_mm = 0.002
"""


def without_fixture(text: str) -> str:
    return re.sub(r"^\[length_check\]\n(?:.+\n)*", "", text, flags=re.MULTILINE)


@pytest.fixture
def load_fixture(cell_text, load_text):
    def load(*replaced: tuple[str, str], more: str = ""):
        section = FIXTURE + more
        for old, new in replaced:
            assert old in section
            section = section.replace(old, new)
        return load_text(f"{without_fixture(cell_text)}\n{section}")

    return load


def test_what_is_not_said_is_assumed_as_of_a_shop_and_a_direction_has_any_length(load_fixture) -> None:
    fixture = load_fixture().settings.length_check
    assert fixture.second_seat == pytest.approx((150.012, 0.0, 500.0))
    assert (fixture.parallel_mrad, fixture.height_mm, fixture.seating_um) == (0.1, 50.0, 5.0)
    assert (fixture.temperature_sigma_k, fixture.expansion_um_m_k) == (1.0, 11.5)
    assert (fixture.mountings, fixture.mounting) == (3, "by-hand")
    assert "distance_mm = 300.012  # line" in describe(load_fixture())
    fixture = load_fixture(more="direction = [0.0, 3.0, 4.0]\nrepeats = 3\n").settings.length_check
    assert fixture.second_seat == pytest.approx((-150.0, 180.0072, 740.0096))
    assert fixture.mountings == 7


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("distance_mm = 300.012\n", "", "'distance_mm' in [length_check] is missing"),
        ("300.012", "0.3", "must be 20 or more"),
        ("300.012", "300012.0", "must be 5000 or less"),
        ("0.002", "2.0", "uncertainty_mm is 2, more than 0.300012 (0.1 % of distance_mm)"),
        ("0.002", "0.0", "must be more than 0"),
        ("0.002\n", "0.002\ndirection = [0.0, 0.0, 0.0]\n", "length zero is no direction"),
        ("0.002\n", "0.002\nrepeats = 0\n", "must be 1 or more"),
        ("0.002\n", "0.002\norientations = 26\n", "must be 25 or less"),
        ("0.002\n", "0.002\ntilt_deg = 60.0\n", "must be 45 or less"),
        ("0.002\n", '0.002\nmounting = "robot"\n', "must be 'by-hand' or 'fixed'"),
        ("0.002\n", "0.002\nseat_mm = 1.0\n", "unknown key 'seat_mm' in [length_check]"),
        ("0.002\n", '0.002\nthermometer = "room"\n', "the cell has no thermometer 'room'"),
    ],
)
def test_a_mistake_is_told_with_its_line(load_fixture, old: str, new: str, words: str) -> None:
    with pytest.raises(FileError) as refused:
        load_fixture((old, new))
    assert words in str(refused.value)
    assert refused.value.line is not None
