"""Simulated instruments answer byte for byte as their manuals say."""

from typing import Any

import pytest

from drivers.simulated.gauges.indicators import Cdi, Mux10, Sylvac
from drivers.simulated.gauges.instruments import Indicator, Instrument

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
def test_it_answers_as_its_manual_says(instrument, state, question, answer):
    indicator = Indicator(lambda: 2.138, travel_mm=12.5)
    for name, value in state.items():
        setattr(indicator, name, value)
    assert instrument({1: indicator}).answer(question) == answer
