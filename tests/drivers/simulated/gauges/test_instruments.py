"""Simulated instruments answer byte for byte as their manuals say."""

from typing import Any

import pytest

from drivers.simulated.gauges.indicators import Cdi, Mux10, Sylvac
from drivers.simulated.gauges.instruments import Indicator, Instrument


class Ball:
    """A plunger position that tests change."""

    position = 2.138

    def __call__(self) -> float:
        return self.position


@pytest.fixture
def ball() -> Ball:
    return Ball()


@pytest.fixture
def indicator(ball: Ball) -> Indicator:
    return Indicator(ball, travel_mm=12.5)


@pytest.mark.parametrize(
    ("position", "shown"), [(6.25, 6.25), (-6.25, -6.25), (0.0, 0.0), (6.26, None), (-6.26, None)]
)
def test_a_position_within_the_travel_is_shown(indicator, ball, position, shown):
    ball.position = position
    assert indicator.shown() == shown


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


INCH, OFF, AT_END = {"inch": True}, {"powered": False}, {"is_at_end": True}
ANSWERS: list[tuple[type[Instrument], dict[str, Any], bytes, bytes]] = [
    (Sylvac, {}, b"?", b"+2.138\r"),
    (Sylvac, {"off_middle_mm": -2.1384}, b"?", b"-0.000\r"),
    (Sylvac, AT_END, b"?", b"ERR3\r"),
    (Sylvac, OFF, b"?", b""),
    (Sylvac, {}, b"PRI", b"+2.138\r"),
    (Sylvac, {}, b"uni ?", b"MM\r"),
    (Sylvac, INCH, b"UNI?", b"IN\r"),
    (Sylvac, {}, b"ID?", b"SY276\r"),
    (Sylvac, {}, b"MOD?", b"NOR\r"),
    (Sylvac, {"peak_mm": 1.0}, b"MOD?", b"MAX\r"),
    (Sylvac, {}, b"STO?", b"STO0\r"),
    (Sylvac, {"held_mm": 1.0}, b"STO?", b"STO1\r"),
    (Sylvac, {}, b"CHA?", b"CHA+\r"),
    (Sylvac, {"reversed": True}, b"CHA?", b"CHA-\r"),
    (Sylvac, {}, b"PRE?", b"PRE +0.000\r"),
    (Sylvac, {}, b"BAT?", b"BAT1\r"),
    (Sylvac, {"battery_low": True}, b"BAT?", b"BAT0\r"),
    (Sylvac, {}, b"XYZ?", b"ERR1\r"),
    (Sylvac, {}, b"", b"ERR1\r"),
    (Sylvac, {}, b"\xff", b"ERR1\r"),
    (Mux10, {}, b"1", b"01A+0002.138\r"),
    (Mux10, INCH, b"1", b"01A+00.08417\r"),
    (Mux10, AT_END, b"1", b"912\r"),
    (Mux10, OFF, b"1", b"911\r"),
    (Mux10, {}, b"2", b"911\r"),
    (Mux10, {}, b"V", b"MUX-10F SIMULATED\r"),
    (Mux10, {}, b"?", b""),
    (Cdi, {}, b"R", b"+  2.1380, MM\r\n"),
    (Cdi, {"reversed": True, "inch": True}, b"R", b"- 0.08417, IN\r\n"),
    (Cdi, AT_END, b"R", b"OUT OF BOUNDS\r\n"),
    (Cdi, {}, b"?p011", b"0\r\n"),
    (Cdi, {"peak_mm": 1.0}, b"?p011", b"1\r\n"),
    (Cdi, {}, b"?P013", b"2\r\n"),
    (Cdi, INCH, b"?p013", b"1\r\n"),
    (Cdi, {"reversed": True}, b"?p019", b"1\r\n"),
    (Cdi, {"held_mm": 1.0}, b"?p021", b"1\r\n"),
    (Cdi, {}, b"?p040", b"0\r\n"),
    (Cdi, {}, b"?p999", b"NOT FOUND\r\n"),
    (Cdi, {}, b"X", b"NOT FOUND\r\n"),
]


@pytest.mark.parametrize(("instrument", "state", "question", "answer"), ANSWERS)
def test_it_answers_as_its_manual_says(indicator, instrument, state, question, answer):
    for name, value in state.items():
        setattr(indicator, name, value)
    assert instrument({1: indicator}).answer(question) == answer


def test_a_multiplexer_is_busy_for_the_number_of_requests_that_is_set(indicator):
    mux10 = Mux10({1: indicator})
    mux10.busy = 2
    assert [mux10.answer(b"1") for _ in range(3)] == [b"918\r", b"918\r", b"01A+0002.138\r"]
