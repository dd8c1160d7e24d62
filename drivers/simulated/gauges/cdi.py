"""A simulated CDI or Starrett indicator: the questions of its serial ASCII protocol, no commands."""

from __future__ import annotations

from drivers.simulated.gauges.device import SingleDevice

NOT_FOUND = b"NOT FOUND\r\n"
OUT_OF_BOUNDS = b"OUT OF BOUNDS\r\n"


def format_value(value: float, *, inch: bool) -> bytes:
    """The answer to ``R``: sign, eight characters filled up with blanks, and the unit."""
    sign = b"-" if value < 0 else b"+"
    number = b"%8.*f" % (5 if inch else 4, abs(value))
    return sign + number + (b", IN\r\n" if inch else b", MM\r\n")


class CdiDevice(SingleDevice):
    """Answers ``R``, and the parameters that can falsify readings."""

    def reply(self, command: bytes) -> bytes:
        """Parameters are asked for as ``?p013``."""
        return self._value() if command == b"R" else self._parameter(command)

    def _value(self) -> bytes:
        shown = self.indicator.shown()
        return OUT_OF_BOUNDS if shown is None else format_value(shown, inch=self.indicator.inch)

    def _parameter(self, question: bytes) -> bytes:
        values = {
            b"?p011": 0,
            b"?p013": 1 if self.indicator.inch else 2,
            b"?p019": int(self.indicator.reversed),
            b"?p021": int(self.indicator.held_mm is not None),
            b"?p040": 0,
        }
        return b"%d\r\n" % values[question] if question in values else NOT_FOUND
