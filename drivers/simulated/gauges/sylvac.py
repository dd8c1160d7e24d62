"""A simulated indicator with Sylvac's opto-RS duplex interface."""

from __future__ import annotations

from typing import ClassVar

from drivers.simulated.gauges.device import SingleDevice

UNKNOWN_COMMAND = b"ERR1\r"
OUT_OF_RANGE = b"ERR3\r"


def format_value(value: float, *, inch: bool) -> bytes:
    """The answer to ``?``: a micrometre or 10 microinches are the last digit."""
    return b"%+.*f\r" % (5 if inch else 3, value)


class SylvacDevice(SingleDevice):
    """Answers the questions of the duplex protocol, and its commands with nothing."""

    baudrate: ClassVar[int] = 4800
    bits_a_byte: ClassVar[int] = 11

    mode = "NOR"
    identification = "SY276"

    def reply(self, command: bytes) -> bytes:
        """Commands may be in lower case and with blanks."""
        word = command.decode("ascii", "replace").replace(" ", "").upper()
        if word in {"?", "PRI"}:
            return self._value()
        if word.endswith("?"):
            return self._setting(word)
        return b"" if self._set(word) else UNKNOWN_COMMAND

    def power_up(self) -> bytes:
        """Maker, instrument and options."""
        return f"{self.identification}.1\r".encode("ascii")

    def _value(self) -> bytes:
        shown = self.indicator.shown()
        return OUT_OF_RANGE if shown is None else format_value(shown, inch=self.indicator.inch)

    def _setting(self, question: str) -> bytes:
        answers = {
            "UNI?": "IN" if self.indicator.inch else "MM",
            "ID?": self.identification,
            "MOD?": self.mode,
            "STO?": f"STO{int(self.indicator.on_hold)}",
            "CHA?": "CHA-" if self.indicator.reversed else "CHA+",
            "PRE?": f"PRE {self.indicator.preset_mm:+.3f}",
            "BAT?": f"BAT{int(not self.indicator.battery_low)}",
        }
        answer = answers.get(question)
        return UNKNOWN_COMMAND if answer is None else f"{answer}\r".encode("ascii")

    def _set(self, word: str) -> bool:
        """Carry out a command; whether it is one."""
        keys = {
            "PRE": self.indicator.recall_preset,
            "STO1": self.indicator.hold,
            "STO0": self.indicator.release,
            "OFF": self.indicator.switch_off,
        }
        settings = {
            "MM": ("inch", False),
            "IN": ("inch", True),
            "CHA+": ("reversed", False),
            "CHA-": ("reversed", True),
        }
        if key := keys.get(word):
            key()
        elif word in settings:
            setattr(self.indicator, *settings[word])
        elif word.startswith("PRE"):
            return self._set_preset(word[3:])
        else:
            return False
        return True

    def _set_preset(self, number: str) -> bool:
        try:
            self.indicator.preset_mm = float(number)
        except ValueError:
            return False
        return True
