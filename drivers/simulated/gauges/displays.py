"""Simulated display units and indicators of which only the value is asked."""

from __future__ import annotations

from typing import ClassVar

from drivers.simulated.gauges.instruments import MM_PER_INCH, Instrument, SingleIndicator


class IdH(Instrument):
    """Mitutoyo ID-H indicators in a chain, each with its number; silent at an end of the travel."""

    has_channels: ClassVar[bool] = True

    def answer(self, command: bytes) -> bytes:
        """The value of the indicator with that number."""
        word, number = command[:2], command[2:]
        indicator = self.indicators.get(int(number)) if number.isdigit() else None
        return self._value(int(number)) if word == b"GA" and indicator and indicator.powered else b""

    def _value(self, channel: int) -> bytes:
        frame = super()._value(channel)
        return frame if self.indicators[channel].peak_mm is None else frame.replace(b"GN", b"GX")

    @staticmethod
    def format_value(channel: int, value: float, *, inch: bool) -> bytes:
        """A tenth of a micrometre is its last digit."""
        return b"GN%02d,%+0*.*f\r\n" % (channel, 10, 5 if inch else 4, value)


class HeidenhainNd(SingleIndicator):
    """A display that is asked with STX."""

    bits_a_byte: ClassVar[int] = 11
    command_end: ClassVar[bytes] = b"\x02"
    at_end: ClassVar[bytes] = b"+    0.0000 ?  \r\n"

    def _reply(self, command: str) -> bytes:
        del command
        return self._value(1)

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        """Sign, ten characters, a blank, the unit, and no status."""
        sign = b"-" if value < 0 else b"+"
        return b"%s%10.*f %s  \r\n" % (sign, 5 if inch else 4, abs(value), b'"' if inch else b" ")


class KeyenceDlRs1a(Instrument):
    """Amplifiers that answer together; their channels are counted from 1, without gaps."""

    has_channels: ClassVar[bool] = True
    at_end: ClassVar[bytes] = b"+999.9999"

    def answer(self, command: bytes) -> bytes:
        """All values to ``M0``, an error to everything else."""
        if command != b"M0":
            return b"ER,%s,00\r\n" % command[:2]
        places = range(1, max(self.indicators) + 1)
        values = [self._value(place) if place in self.indicators else self.at_end for place in places]
        return b"M0,%s\r\n" % b",".join(values)

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        """It knows millimetres only."""
        return b"%+09.4f" % (value * MM_PER_INCH if inch else value)


class DigimaticUsb(SingleIndicator):
    """A microcontroller that asks the indicator when a line comes."""

    command_end: ClassVar[bytes] = b"\n"
    at_end: ClassVar[bytes] = b"# no data\n"

    def _reply(self, command: str) -> bytes:
        del command
        return self._value(1)

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        return b"%.*f\n" % (5 if inch else 3, value)


class Uwave(Instrument):
    """Mitutoyo's U-WAVE-R: what an indicator does not show is not sent."""

    baudrate: ClassVar[int] = 57600
    period_s: ClassVar[float | None] = 0.05
    has_channels: ClassVar[bool] = True

    def answer(self, command: bytes) -> bytes:
        del command
        return b""

    @staticmethod
    def format_value(channel: int, value: float, *, inch: bool) -> bytes:
        """A frame of one transmitter; a status line now and then is ignored by readers."""
        unit, decimals = (b"I", 5) if inch else (b"M", 3)
        sign = b"-" if value < 0 else b"+"
        return b"DT1%04d%s%011.*f%s\r" % (channel, sign, decimals, abs(value), unit)
