"""Simulated indicators, multiplexers and display units; drivers send them nothing but questions."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import ClassVar

from drivers.simulated.gauges.instruments import MM_PER_INCH, Indicator, Instrument, SingleIndicator


class Mux10(Instrument):
    """A multiplexer with MUX-10 frames: answers a channel number with the value of its indicator.

    It answers the next ``busy`` requests with an error.
    """

    has_channels: ClassVar[bool] = True
    at_end: ClassVar[bytes] = b"912\r"

    def __init__(self, indicators: Mapping[int, Indicator]) -> None:
        super().__init__(indicators)
        self.busy = 0

    def answer(self, command: bytes) -> bytes:
        """A data frame or an error; nothing if the command is no channel number and not ``V``."""
        if command == b"V":
            return b"MUX-10F SIMULATED\r"
        if not command.isdigit():
            return b""
        if self.busy:
            self.busy -= 1
            return b"918\r"
        indicator = self.indicators.get(int(command))
        return self._value(int(command)) if indicator and indicator.powered else b"911\r"

    @staticmethod
    def format_value(channel: int, value: float, *, inch: bool) -> bytes:
        """A data frame: eight characters of digits and point, the sign apart."""
        sign = b"-" if value < 0 else b"+"
        return b"0%dA%s%08.*f\r" % (channel, sign, 5 if inch else 3, abs(value))


class Sylvac(SingleIndicator):
    """Sylvac's opto-RS duplex protocol: a command that is obeyed has no answer."""

    baudrate: ClassVar[int] = 4800
    bits_a_byte: ClassVar[int] = 11
    at_end: ClassVar[bytes] = b"ERR3\r"
    introduction: ClassVar[bytes] = b"SY276.1\r"

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        """A micrometre or 10 microinches are the last digit."""
        return b"%+.*f\r" % (5 if inch else 3, value)

    def _reply(self, command: str) -> bytes:
        """Commands may be in lower case and with blanks."""
        word = command.replace(" ", "").upper()
        if word in {"?", "PRI"}:
            return self._value(1)
        if word.endswith("?"):
            return self._settings().get(word, "ERR1").encode("ascii") + b"\r"
        return b"" if self._obeys(word) else b"ERR1\r"

    def _settings(self) -> dict[str, str]:
        indicator = self.indicator
        return {
            "UNI?": "IN" if indicator.inch else "MM",
            "ID?": "SY276",
            "MOD?": "NOR" if indicator.peak_mm is None else "MAX",
            "STO?": "STO0" if indicator.held_mm is None else "STO1",
            "CHA?": "CHA-" if indicator.reversed else "CHA+",
            "PRE?": f"PRE {indicator.preset_mm:+.3f}",
            "BAT?": "BAT0" if indicator.battery_low else "BAT1",
        }

    def _obeys(self, word: str) -> bool:
        """Carry out a command; whether it is one."""
        indicator = self.indicator
        match word:
            case "MM" | "IN":
                indicator.inch = word == "IN"
            case "CHA+" | "CHA-":
                indicator.reversed = word == "CHA-"
            case "STO0" | "STO1":
                indicator.set_hold(on=word == "STO1")
            case "PRE":
                indicator.recall_preset()
            case "OFF":
                indicator.powered = False
            case _:
                return word.startswith("PRE") and self._set_preset(word[3:])
        return True

    def _set_preset(self, number: str) -> bool:
        try:
            self.indicator.preset_mm = float(number)
        except ValueError:
            return False
        return True


class Cdi(SingleIndicator):
    """The serial ASCII protocol of CDI and Starrett, with the parameters that can falsify a value."""

    at_end: ClassVar[bytes] = b"OUT OF BOUNDS\r\n"

    def __init__(self, indicators: Mapping[int, Indicator]) -> None:
        super().__init__(indicators)
        self._without_effect = {"011": 0, "040": 0}  # mode and ratio are only stored

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        """Sign, eight characters filled up with blanks, and the unit."""
        sign = b"-" if value < 0 else b"+"
        number = b"%8.*f" % (5 if inch else 4, abs(value))
        return sign + number + (b", IN\r\n" if inch else b", MM\r\n")

    def _reply(self, command: str) -> bytes:
        """Parameters are asked for as ``?p013`` and set as ``p013=2``."""
        match command:
            case "R":
                return self._value(1)
            case "C":
                self.indicator.recall_preset()
                return b"SUCCESS\r\n"
            case "H":
                self.indicator.set_hold(on=self.indicator.held_mm is None)
                return b"SUCCESS\r\n"
        return self._parameter(command)

    def _parameter(self, command: str) -> bytes:
        match = re.fullmatch(r"(\?)?[pP](\d{3})(?:=(.*))?", command)
        parameters = self._parameters()
        if match is None or match[2] not in parameters:
            return b"NOT FOUND\r\n"
        asked, number, setting = match.groups()
        return b"%d\r\n" % parameters[number] if asked else self._set(number, setting or "")

    def _parameters(self) -> dict[str, int]:
        indicator = self.indicator
        peak = {} if indicator.peak_mm is None else {"011": 1}
        return self._without_effect | {
            "013": 1 if indicator.inch else 2,
            "019": int(indicator.reversed),
            "021": int(indicator.held_mm is not None),
            **peak,
        }

    def _set(self, number: str, setting: str) -> bytes:
        if not setting.isdigit():
            return b"NON NUMERIC\r\n"
        value = int(setting)
        if value not in {"011": range(3), "013": range(1, 3)}.get(number, range(2)):
            return b"OUT OF BOUNDS\r\n"
        match number:
            case "013":
                self.indicator.inch = value == 1
            case "019":
                self.indicator.reversed = value == 1
            case "021":
                self.indicator.set_hold(on=value == 1)
            case _:
                self._without_effect[number] = value
        return b"SUCCESS\r\n"


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

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        return b"%.*f\n" % (5 if inch else 3, value)


class Uwave(Instrument):
    """Mitutoyo's U-WAVE-R: what an indicator does not show is not sent."""

    baudrate: ClassVar[int] = 57600
    period_s: ClassVar[float | None] = 0.05
    has_channels: ClassVar[bool] = True

    @staticmethod
    def format_value(channel: int, value: float, *, inch: bool) -> bytes:
        """A frame of one transmitter; a status line now and then is ignored by readers."""
        unit, decimals = (b"I", 5) if inch else (b"M", 3)
        sign = b"-" if value < 0 else b"+"
        return b"DT1%04d%s%011.*f%s\r" % (channel, sign, decimals, abs(value), unit)
