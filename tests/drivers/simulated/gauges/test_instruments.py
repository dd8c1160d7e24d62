"""Simulated instruments answer byte for byte as their manuals say."""

import pytest

from drivers.simulated.gauges.indicator import Indicator
from drivers.simulated.gauges.instruments import Cdi, Mux10, Sylvac


class Ball:
    """A plunger position that tests change."""

    def __init__(self, position):
        self.position = position

    def __call__(self):
        return self.position


@pytest.fixture
def ball():
    return Ball(2.138)


@pytest.fixture
def indicator(ball):
    return Indicator(ball, travel_mm=12.5)


@pytest.fixture
def sylvac(indicator):
    return Sylvac({1: indicator})


@pytest.fixture
def mux10(indicator):
    return Mux10({2: indicator})


@pytest.fixture
def cdi(indicator):
    return Cdi({1: indicator})


# The instrument


@pytest.mark.parametrize("position", [6.25, -6.25, 0.0])
def test_within_its_travel_it_shows_a_value(indicator, ball, position):
    ball.position = position
    assert indicator.shown() == position


@pytest.mark.parametrize("position", [6.26, -6.26, 1000.0])
def test_outside_its_travel_it_does_not(indicator, ball, position):
    ball.position = position
    assert indicator.shown() is None


def test_a_held_value_is_shown_even_outside_the_travel(indicator, ball):
    indicator.held_mm = 2.138
    ball.position = 99.0
    assert indicator.shown() == 2.138
    indicator.held_mm = None
    assert indicator.shown() is None


def test_inch_and_reversal_combine(indicator, ball):
    ball.position = 2.54
    indicator.reversed = True
    indicator.inch = True
    assert indicator.shown() == pytest.approx(-0.1)


# Sylvac


@pytest.mark.parametrize(
    ("position", "answer"), [(2.138, b"+2.138\r"), (-0.0004, b"-0.000\r"), (99.0, b"ERR3\r")]
)
def test_sylvac_answers_with_its_value(sylvac, ball, position, answer):
    ball.position = position
    assert sylvac.answer(b"?") == answer


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (b"UNI?", b"MM\r"),
        (b"ID?", b"SY276\r"),
        (b"MOD?", b"NOR\r"),
        (b"STO?", b"STO0\r"),
        (b"CHA?", b"CHA+\r"),
        (b"PRE?", b"PRE +0.000\r"),
        (b"BAT?", b"BAT1\r"),
        (b"XYZ?", b"ERR1\r"),
        (b"XYZ", b"ERR1\r"),
        (b"\xff", b"ERR1\r"),
    ],
)
def test_sylvac_answers_questions(sylvac, question, answer):
    assert sylvac.answer(question) == answer


@pytest.mark.parametrize(
    ("setting", "value", "question", "answer"),
    [
        ("inch", True, b"?", b"+0.08417\r"),
        ("inch", True, b"UNI?", b"IN\r"),
        ("reversed", True, b"?", b"-2.138\r"),
        ("reversed", True, b"CHA?", b"CHA-\r"),
        ("held_mm", 1.0, b"STO?", b"STO1\r"),
        ("battery_low", True, b"BAT?", b"BAT0\r"),
        ("powered", False, b"?", b""),
    ],
)
def test_sylvac_answers_by_its_settings(sylvac, indicator, setting, value, question, answer):
    setattr(indicator, setting, value)
    assert sylvac.answer(question) == answer


# MUX-10


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"2", b"02A+0002.138\r"),
        (b"1", b"911\r"),
        (b"V", b"MUX-10F SIMULATED\r"),
        (b"?", b""),
        (b"", b""),
    ],
)
def test_mux10_answers(mux10, command, answer):
    assert mux10.answer(command) == answer


def test_mux10_reports_errors_units_and_absent_gauges(mux10, ball, indicator):
    indicator.inch = True
    assert mux10.answer(b"2") == b"02A+00.08417\r"
    ball.position = -99.0
    assert mux10.answer(b"2") == b"912\r"
    indicator.powered = False
    assert mux10.answer(b"2") == b"911\r"


# CDI


def test_cdi_answers_with_value_and_unit(cdi, ball, indicator):
    assert cdi.answer(b"R") == b"+  2.1380, MM\r\n"
    ball.position = -2.138
    assert cdi.answer(b"R") == b"-  2.1380, MM\r\n"
    indicator.inch = True
    assert cdi.answer(b"R") == b"- 0.08417, IN\r\n"
    ball.position = 99.0
    assert cdi.answer(b"R") == b"OUT OF BOUNDS\r\n"


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (b"?p011", b"0\r\n"),
        (b"?p013", b"2\r\n"),
        (b"?p999", b"NOT FOUND\r\n"),
        (b"X", b"NOT FOUND\r\n"),
    ],
)
def test_cdi_answers_for_parameters(cdi, command, answer):
    assert cdi.answer(command) == answer


@pytest.mark.parametrize(
    ("setting", "value", "question", "answer"),
    [
        ("inch", True, b"R", b"+ 0.08417, IN\r\n"),
        ("inch", True, b"?p013", b"1\r\n"),
        ("reversed", True, b"R", b"-  2.1380, MM\r\n"),
        ("reversed", True, b"?p019", b"1\r\n"),
        ("held_mm", 1.0, b"?p021", b"1\r\n"),
    ],
)
def test_cdi_answers_by_its_settings(cdi, indicator, setting, value, question, answer):
    setattr(indicator, setting, value)
    assert cdi.answer(question) == answer
