"""A simulated CDI or Starrett indicator with the serial ASCII command protocol."""

from __future__ import annotations

import re

from drivers.simulated.gauges.device import SingleDevice

SUCCESS = b"SUCCESS\r\n"
NOT_FOUND = b"NOT FOUND\r\n"
NO_ACCESS = b"NO ACCESS\r\n"
OUT_OF_BOUNDS = b"OUT OF BOUNDS\r\n"
NON_NUMERIC = b"NON NUMERIC\r\n"
COMMAND = re.compile(r"(\?)?p(\d{3})(?:=(.*))?", re.IGNORECASE)


def format_value(value: float, *, inch: bool) -> bytes:
    """The answer to ``R``: sign, eight characters filled up with blanks, and the unit."""
    sign = b"-" if value < 0 else b"+"
    number = b"%8.*f" % (5 if inch else 4, abs(value))
    return sign + number + (b", IN\r\n" if inch else b", MM\r\n")


class CdiDevice(SingleDevice):
    """Answers ``R``, ``C``, ``H`` and the parameters that can falsify readings."""

    mode = 0
    ratio = 0

    def reply(self, command: bytes) -> bytes:
        """Parameters are asked for as ``?p013`` and set as ``p013=2``."""
        text = command.decode("ascii", "replace")
        if text == "R":
            return self._value()
        if text == "C":
            self.indicator.recall_preset()
            return SUCCESS
        if text == "H":
            self._hold(on=not self.indicator.on_hold)
            return SUCCESS
        match = COMMAND.fullmatch(text)
        return NOT_FOUND if match is None else self._parameter(match)

    def _value(self) -> bytes:
        shown = self.indicator.shown()
        return OUT_OF_BOUNDS if shown is None else format_value(shown, inch=self.indicator.inch)

    def _parameter(self, match: re.Match[str]) -> bytes:
        asked, number, setting = match.groups()
        value = self._settings().get(number)
        if value is None:
            return NOT_FOUND
        if asked:
            return b"%d\r\n" % value
        return self._set(number, setting or "")

    def _settings(self) -> dict[str, int]:
        return {
            "011": self.mode,
            "013": 1 if self.indicator.inch else 2,
            "019": int(self.indicator.reversed),
            "021": int(self.indicator.on_hold),
            "040": self.ratio,
        }

    def _set(self, number: str, setting: str) -> bytes:
        if not setting.isdigit():
            return NON_NUMERIC
        value = int(setting)
        allowed = {"011": range(3), "013": range(1, 3)}.get(number, range(2))
        if value not in allowed:
            return OUT_OF_BOUNDS
        match number:
            case "011":
                self.mode = value
            case "013":
                self.indicator.inch = value == 1
            case "019":
                self.indicator.reversed = value == 1
            case "021":
                self._hold(on=value == 1)
            case _:
                self.ratio = value
        return SUCCESS

    def _hold(self, *, on: bool) -> None:
        if on:
            self.indicator.hold()
        else:
            self.indicator.release()
