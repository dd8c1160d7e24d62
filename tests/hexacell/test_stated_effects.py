"""Each size that a cell file states becomes one effect of the budget, with its source."""

import pytest

from hexacell.cell.bundled import bundled_config
from hexacell.cell.loader import load_cell
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.kinematics.parameters import MachinePart
from hexacell.robot.stated import stated_effects
from hexacell.uncertainty.effects import Occurrence

CONSTANTS = {
    *("grade", "sources", "rail_wave_short_mm", "rail_wave_long_mm", "leg_compliance_um_n"),
    *("stop_repeatability_acts", "own_weight_centre_mm", "own_weight_direction", "thermometers_k"),
}


@pytest.fixture(scope="module")
def ideal():
    return load_cell(bundled_config("simulated-hexaglide")).settings


def with_sizes(settings, **sizes):
    return settings.model_copy(update={"uncertainty": UncertaintySettings(**sizes)})


def sizes_of(settings):
    return {effect.name: effect.size for effect in stated_effects(settings)}


def test_the_simulation_has_none(ideal) -> None:
    assert set(sizes_of(ideal).values()) == {0.0}


def test_every_size_of_the_section_belongs_to_one_effect(ideal) -> None:
    zeros = dict.fromkeys(sizes_of(ideal), 0.0)
    keys = [
        key
        for key in UncertaintySettings.model_fields
        if key not in CONSTANTS and not key.startswith("expansion")
    ]
    named = set()
    for key in keys:
        sizes = sizes_of(with_sizes(ideal, grade="ideal", **{key: 7.0}))
        (changed,) = (name for name in sizes if sizes[name] != zeros[name])
        assert sizes[changed] == 7.0
        named.add(changed)
    of_noise = {"scale of each gauge", "stops of a slider beside its command"}
    assert named == set(zeros) - of_noise


def test_the_scale_of_the_gauges_is_estimated_and_sources_go_with_the_effects(ideal) -> None:
    noisy = ideal.model_copy(update={"noise": ideal.noise.model_copy(update={"gauge_scale": 0.002})})
    (scale,) = (effect for effect in stated_effects(noisy) if effect.is_estimated)
    assert (scale.name, scale.size, scale.unit) == ("scale of each gauge", 2.0, "um/mm")
    assert scale.occurrence is Occurrence.MEASURING
    stated = with_sizes(ideal, sources={"load_n": "spindle"}, rail_wave_short_um=1.0)
    sources = {effect.name: effect.source for effect in stated_effects(stated)}
    assert sources["load at work"] == "spindle"
    assert sources["waves of the rails, 600 mm long"] == "cell file"
    assert sources["sag common to all rails"] == "assumed: precision"


def test_thermometers_take_the_place_of_temperature_and_of_expansion(ideal) -> None:
    effects = stated_effects(with_sizes(ideal), measured_range_k=0.3)
    (drift,) = (effect for effect in effects if effect.name == "temperature while measuring")
    assert (drift.size, drift.source) == (0.3, "thermometers")
    stated = with_sizes(ideal, thermometers_k=0.2)
    alone = {effect.name: effect for effect in stated_effects(stated, 6.0, {MachinePart.LEGS})}
    assert alone["thermometers of the legs"].size == 0.2
    assert alone["coefficients of thermal expansion"].size == 10.0
    assert alone["temperature while measuring"].size == 6.0, "the base may have become as warm"
    assert "thermometers of the legs" not in {effect.name for effect in stated_effects(stated, 6.0)}
