"""``[length_check]``: a fixture with two seats, and what a certificate cannot say."""

import re

import pytest

from hexacell.cell.loader import describe
from hexacell.errors import FileError

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


def test_what_is_not_said_is_assumed_as_of_a_shop(load_fixture) -> None:
    fixture = load_fixture().settings.length_check
    assert fixture.second_seat == pytest.approx((150.012, 0.0, 500.0))
    assert (fixture.parallel_mrad, fixture.height_mm, fixture.seating_um) == (0.1, 50.0, 5.0)
    assert (fixture.temperature_sigma_k, fixture.expansion_um_m_k) == (1.0, 11.5)
    assert (fixture.mountings, fixture.mounting) == (3, "by-hand")
    assert "distance_mm = 300.012  # line" in describe(load_fixture())


def test_a_direction_is_one_whatever_its_length(load_fixture) -> None:
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
