"""A simulated multiplexer with MUX-10 frames, and the indicators on its channels."""

from __future__ import annotations

from drivers.simulated.gauges.device import LineDevice

NO_GAUGE = b"911\r"
GAUGE_ERROR = b"912\r"
IDENTIFICATION = b"MUX-10F SIMULATED\r"


def format_value(channel: int, value: float, *, inch: bool) -> bytes:
    """A data frame: eight characters of digits and point, the sign apart."""
    sign = b"-" if value < 0 else b"+"
    return b"0%dA%s%08.*f\r" % (channel, sign, 5 if inch else 3, abs(value))


class Mux10Device(LineDevice):
    """Answers a channel number with the value of its indicator."""

    def answer(self, command: bytes) -> bytes:
        """A data frame or an error; nothing if the command is no channel number and not ``V``."""
        if command == b"V":
            return IDENTIFICATION
        if not command.isdigit():
            return b""
        return self._value(int(command))

    def _value(self, channel: int) -> bytes:
        indicator = self.indicators.get(channel)
        if indicator is None or not indicator.powered:
            return NO_GAUGE
        shown = indicator.shown()
        return GAUGE_ERROR if shown is None else format_value(channel, shown, inch=indicator.inch)
