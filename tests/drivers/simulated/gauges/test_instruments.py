"""Simulated instruments answer byte for byte as their manuals say."""

import pytest

from drivers.simulated.gauges.indicators import Cdi, Mux10, Sylvac
from drivers.simulated.gauges.instruments import Indicator


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
def test_a_position_within_the_travel_is_shown(indicator, ball, position):
    ball.position = position
    assert indicator.shown() == position


@pytest.mark.parametrize("position", [6.26, -6.26, 1000.0])
def test_a_position_outside_the_travel_is_not_shown(indicator, ball, position):
    ball.position = position
    assert indicator.shown() is None


def test_a_held_value_is_shown_even_outside_the_travel(indicator, ball):
    indicator.set_hold(on=True)
    ball.position = 99.0
    assert indicator.shown() == 2.138
    indicator.set_hold(on=False)
    assert indicator.shown() is None


def test_inch_reversal_and_zero_combine(indicator, ball):
    indicator.reversed = True
    assert indicator.shown() == -2.138
    indicator.set_zeroed(on=True)
    indicator.inch = True
    assert indicator.shown() == pytest.approx(0.0)
    ball.position += 2.54
    assert indicator.shown() == pytest.approx(-0.1)


def test_switching_on_again_loses_zero_and_hold(indicator, ball):
    indicator.set_hold(on=True)
    indicator.powered = False
    indicator.switch_on()
    assert indicator.powered
    assert indicator.shown() == 0.0
    ball.position += 1.0
    assert indicator.shown() == pytest.approx(1.0)


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
        (b"PRI", b"+2.138\r"),
        (b"UNI?", b"MM\r"),
        (b"uni ?", b"MM\r"),
        (b"ID?", b"SY276\r"),
        (b"MOD?", b"NOR\r"),
        (b"STO?", b"STO0\r"),
        (b"CHA?", b"CHA+\r"),
        (b"PRE?", b"PRE +0.000\r"),
        (b"BAT?", b"BAT1\r"),
        (b"XYZ?", b"ERR1\r"),
        (b"XYZ", b"ERR1\r"),
        (b"", b"ERR1\r"),
        (b"\xff", b"ERR1\r"),
    ],
)
def test_sylvac_answers_questions(sylvac, question, answer):
    assert sylvac.answer(question) == answer


def test_sylvac_reports_its_settings(sylvac, indicator):
    indicator.battery_low = indicator.inch = indicator.reversed = True
    indicator.set_hold(on=True)
    indicator.set_peak(on=True)
    answers = [sylvac.answer(question) for question in (b"BAT?", b"UNI?", b"CHA?", b"STO?", b"MOD?")]
    assert answers == [b"BAT0\r", b"IN\r", b"CHA-\r", b"STO1\r", b"MAX\r"]
    indicator.powered = False
    assert sylvac.answer(b"?") == b""


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


def test_mux10_is_busy_for_the_number_of_requests_that_is_set(mux10):
    mux10.busy = 2
    assert [mux10.answer(b"2") for _ in range(3)] == [b"918\r", b"918\r", b"02A+0002.138\r"]


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
        (b"?P013", b"2\r\n"),
        (b"?p999", b"NOT FOUND\r\n"),
        (b"X", b"NOT FOUND\r\n"),
        (b"r", b"NOT FOUND\r\n"),
    ],
)
def test_cdi_answers_for_parameters(cdi, command, answer):
    assert cdi.answer(command) == answer


def test_cdi_reports_its_settings(cdi, indicator):
    indicator.inch = indicator.reversed = True
    indicator.set_hold(on=True)
    indicator.set_peak(on=True)
    answers = [cdi.answer(b"?p%03d" % number) for number in (11, 13, 19, 21, 40)]
    assert answers == [b"1\r\n", b"1\r\n", b"1\r\n", b"1\r\n", b"0\r\n"]
