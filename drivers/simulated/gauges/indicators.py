"""Simulated indicators, multiplexers and display units; drivers send them nothing but questions."""

from typing import ClassVar

from drivers.simulated.gauges.instruments import MM_PER_INCH, Instrument, SingleIndicator


class Mux10(Instrument):
    """A multiplexer with MUX-10 frames: answers a channel number with the value of its indicator."""

    has_channels: ClassVar[bool] = True
    at_end: ClassVar[bytes] = b"912\r"

    def answer(self, command: bytes) -> bytes:
        """A data frame or an error; nothing if the command is no channel number and not ``V``."""
        if command == b"V":
            return b"MUX-10F SIMULATED\r"
        if not command.isdigit():
            return b""
        indicator = self.indicators.get(int(command))
        return self._value(int(command)) if indicator and indicator.powered else b"911\r"

    def format_value(self, channel: int, value: float, *, inch: bool) -> bytes:
        """A data frame: eight characters of digits and point, the sign apart."""
        return b"0%dA%+09.*f\r" % (channel, 5 if inch else 3, value)


class Sylvac(SingleIndicator):
    """Sylvac's opto-RS duplex protocol."""

    baudrate: ClassVar[int] = 4800
    bits_a_byte: ClassVar[int] = 11
    at_end: ClassVar[bytes] = b"ERR3\r"
    introduction: ClassVar[bytes] = b"SY276.1\r"

    def format_value(self, _channel: int, value: float, *, inch: bool) -> bytes:
        """A micrometre or 10 microinches are the last digit."""
        return b"%+.*f\r" % (5 if inch else 3, value)

    def _reply(self, command: str) -> bytes:
        """Commands may be in lower case and with blanks."""
        word = command.replace(" ", "").upper()
        if word in {"?", "PRI"}:
            return self._value(1)
        indicator = self.indicator
        settings = {
            "UNI?": "IN" if indicator.inch else "MM",
            "ID?": "SY276",
            "MOD?": "NOR" if indicator.peak_mm is None else "MAX",
            "STO?": "STO0" if indicator.held_mm is None else "STO1",
            "CHA?": "CHA-" if indicator.reversed else "CHA+",
            "PRE?": "PRE +0.000",
            "BAT?": "BAT0" if indicator.battery_low else "BAT1",
        }
        return settings.get(word, "ERR1").encode("ascii") + b"\r"


class Cdi(SingleIndicator):
    """The serial ASCII protocol of CDI and Starrett, with the parameters that can falsify a value."""

    at_end: ClassVar[bytes] = b"OUT OF BOUNDS\r\n"

    def format_value(self, _channel: int, value: float, *, inch: bool) -> bytes:
        """Sign, eight characters filled up with blanks, and the unit."""
        sign = b"-" if value < 0 else b"+"
        number = b"%8.*f" % (5 if inch else 4, abs(value))
        return sign + number + (b", IN\r\n" if inch else b", MM\r\n")

    def _reply(self, command: str) -> bytes:
        """Parameters are asked for as ``?p013``: the mode is TIR with a peak, else ABS; no ratio."""
        if command == "R":
            return self._value(1)
        indicator = self.indicator
        parameters = {
            "?P011": indicator.peak_mm is not None,
            "?P013": 1 if indicator.inch else 2,
            "?P019": indicator.reversed,
            "?P021": indicator.held_mm is not None,
            "?P040": 0,
        }
        number = parameters.get(command.replace("p", "P"))
        return b"NOT FOUND\r\n" if number is None else b"%d\r\n" % number


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

    def format_value(self, channel: int, value: float, *, inch: bool) -> bytes:
        """A tenth of a micrometre is its last digit."""
        return b"GN%02d,%+0*.*f\r\n" % (channel, 10, 5 if inch else 4, value)


class HeidenhainNd(SingleIndicator):
    """A display that is asked with STX."""

    bits_a_byte: ClassVar[int] = 11
    command_end: ClassVar[bytes] = b"\x02"
    at_end: ClassVar[bytes] = b"+    0.0000 ?  \r\n"

    def format_value(self, _channel: int, value: float, *, inch: bool) -> bytes:
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

    def format_value(self, _channel: int, value: float, *, inch: bool) -> bytes:
        """It knows millimetres only."""
        return b"%+09.4f" % (value * MM_PER_INCH if inch else value)


class DigimaticUsb(SingleIndicator):
    """A microcontroller that asks the indicator when a line comes."""

    command_end: ClassVar[bytes] = b"\n"
    at_end: ClassVar[bytes] = b"# no data\n"

    def format_value(self, _channel: int, value: float, *, inch: bool) -> bytes:
        return b"%.*f\n" % (5 if inch else 3, value)


class Uwave(Instrument):
    """Mitutoyo's U-WAVE-R: what an indicator does not show is not sent."""

    baudrate: ClassVar[int] = 57600
    period_s: ClassVar[float | None] = 0.05
    has_channels: ClassVar[bool] = True

    def format_value(self, channel: int, value: float, *, inch: bool) -> bytes:
        """A frame of one transmitter; a status line now and then is ignored by readers."""
        unit, decimals = (b"I", 5) if inch else (b"M", 3)
        return b"DT1%04d%+012.*f%s\r" % (channel, decimals, value, unit)
