"""``[uncertainty]``: sizes of a grade, those that replace them, and where each comes from."""

from typing import get_args

import pytest

from hexacell.cell.uncertainty import SIZES_OF_GRADES, Grade, RotaryUncertaintySettings, UncertaintySettings

SECTION = '[uncertainty]\ngrade = "ideal"\n'
SIZES = set(UncertaintySettings.model_fields) - {"grade", "sources", "stop_repeatability_acts"}


@pytest.fixture
def load_section(load_changed):
    return lambda lines: load_changed((SECTION, lines))


def test_a_cell_without_the_section_is_no_ideal_machine(load_section) -> None:
    stated = load_section("").settings.uncertainty
    assert stated.grade == "precision"
    assert stated.encoder_scale_um_m == 10.0
    assert stated.load_n == 20.0


@pytest.mark.parametrize("grade", get_args(Grade))
def test_every_grade_is_told_and_only_states_sizes_that_exist(load_section, grade: Grade) -> None:
    assert set(SIZES_OF_GRADES[grade]) <= SIZES | set(RotaryUncertaintySettings.model_fields)
    cell = load_section(f'[uncertainty]\ngrade = "{grade}"\n')
    stated = cell.settings.uncertainty
    sizes = {key: size for key, size in SIZES_OF_GRADES[grade].items() if key in SIZES}
    assert {key: getattr(stated, key) for key in sizes} == sizes


def test_a_size_replaces_that_of_the_grade_and_has_its_source(load_section) -> None:
    stated = load_section(
        '[uncertainty]\ngrade = "ordinary"\nload_n = 50\nrail_wave_long_um = 4.0\n'
        'sources = {rail_wave_long_um = "certificate 7"}\n'
    ).settings.uncertainty
    assert (stated.load_n, stated.rail_wave_long_um, stated.rail_wave_short_um) == (50.0, 4.0, 5.0)
    sources = [stated.source(key) for key in ("load_n", "rail_wave_long_um", "rail_wave_short_um")]
    assert sources == ["cell file", "certificate 7", "assumed: ordinary"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('grade = "superb"', "'precision', 'ordinary' or 'ideal'"),
        ("grade = 3", "'precision', 'ordinary' or 'ideal'"),
        ("load_n = -1.0", "0 or more"),
        ("rail_wave_long_mm = 0.0", "more than 0"),
        ('sources = {load = "drawing"}', "sources has load, which is no size"),
        ("weight_n = 3.0", "unknown key"),
    ],
)
def test_mistakes_are_named_with_their_line(refusal, cell_text, line_with, line, words) -> None:
    refusal(cell_text.replace(SECTION, f"[uncertainty]\n{line}\n", 1), words, line_with("[uncertainty]"))
