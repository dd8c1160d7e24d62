"""Keys of the cell file are in the unit of the joint variables, and say so; no other is accepted."""

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
        (
            "counts_per_turn = 4194304",
            "measuring_step_nm = 1000",
            "unknown key 'measuring_step_nm' in [encoders]",
        ),
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
