"""``[noise]``: one figure for all instruments of a kind, or one each; how a run measures it."""

import pytest

from hexacell.robot.model import noise_of

STATED = "encoder_mm = 0.01\ngauge_mm = 0.01\n"


@pytest.fixture
def load_noise(load_changed):
    return lambda lines: load_changed((STATED, lines)).settings


def test_one_figure_is_that_of_all_instruments_of_a_kind(load_noise) -> None:
    noise = noise_of(load_noise("encoder_mm = 0.02\ngauge_mm = 0.005\n"))
    assert noise.encoders.tolist() == [0.02] * 6
    assert noise.gauges_mm.tolist() == [0.005] * 3


def test_each_instrument_may_have_its_own(load_noise) -> None:
    noise = noise_of(load_noise("gauges_mm = [0.01, 0.03, 0.01]\nencoder_mm = 0.02\n"))
    assert noise.gauges_mm.tolist() == pytest.approx([0.01, 0.03, 0.01])
    assert noise.encoders.tolist() == pytest.approx([0.02] * 6)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("standstill_readings = 5", "5 standstill_readings are no series"),
        ("standstill_readings = -1", "0 or more"),
        ("averaged_windows = 0", "1 or more"),
        ('figures = "guessed"', "'stated' or 'measured'"),
        ("gauges_mm = [0.01, 0.0, 0.01]", "more than 0"),
        ("encoders_mm = [0.01]", "6"),
    ],
)
def test_mistakes_are_named_with_their_line(refusal, cell_text, line_with, line, words) -> None:
    refusal(cell_text.replace(STATED, f"{STATED}{line}\n", 1), words, line_with("[noise]"))
