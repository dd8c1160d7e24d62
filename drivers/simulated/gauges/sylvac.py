"""A simulated Sylvac indicator: the questions of the opto-RS duplex protocol, no commands."""

from __future__ import annotations

from typing import ClassVar

from drivers.simulated.gauges.device import SingleDevice

UNKNOWN_COMMAND = b"ERR1\r"
OUT_OF_RANGE = b"ERR3\r"


def format_value(value: float, *, inch: bool) -> bytes:
    """The answer to ``?``: a micrometre or 10 microinches are the last digit."""
    return b"%+.*f\r" % (5 if inch else 3, value)


class SylvacDevice(SingleDevice):
    """Answers the questions of the duplex protocol."""

    baudrate: ClassVar[int] = 4800
    bits_a_byte: ClassVar[int] = 11

    def reply(self, command: bytes) -> bytes:
        """The value, or a setting."""
        return self._value() if command == b"?" else self._setting(command)

    def _value(self) -> bytes:
        shown = self.indicator.shown()
        return OUT_OF_RANGE if shown is None else format_value(shown, inch=self.indicator.inch)

    def _setting(self, question: bytes) -> bytes:
        answers = {
            b"UNI?": b"IN\r" if self.indicator.inch else b"MM\r",
            b"ID?": b"SY276\r",
            b"MOD?": b"NOR\r",
            b"STO?": b"STO0\r" if self.indicator.held_mm is None else b"STO1\r",
            b"CHA?": b"CHA-\r" if self.indicator.reversed else b"CHA+\r",
            b"PRE?": b"PRE +0.000\r",
            b"BAT?": b"BAT0\r" if self.indicator.battery_low else b"BAT1\r",
        }
        return answers.get(question, UNKNOWN_COMMAND)
