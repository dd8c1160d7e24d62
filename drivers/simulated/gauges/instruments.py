"""Simulated instruments: indicators behind the protocols of the drivers, which ask and never command."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from drivers.simulated.gauges.indicator import Indicator


class Instrument(ABC):
    """An indicator, or a multiplexer with several, that answers commands.

    ``indicators`` are by channel, counted from 1; all but a multiplexer have channel 1 only.
    """

    baudrate: ClassVar[int] = 9600
    bits_a_byte: ClassVar[int] = 10  # with start, parity and stop bits
    at_end: ClassVar[bytes]
    """The answer with the plunger at an end of its travel."""

    def __init__(self, indicators: Mapping[int, Indicator]) -> None:
        self.indicators = dict(indicators)

    @abstractmethod
    def answer(self, command: bytes) -> bytes:
        """The answer to ``command``, which has no carriage return."""

    @staticmethod
    @abstractmethod
    def format_value(channel: int, value: float, *, inch: bool) -> bytes:
        """The answer with a value, mm or inch."""

    def _value(self, channel: int) -> bytes:
        indicator = self.indicators[channel]
        shown = indicator.shown()
        return self.at_end if shown is None else self.format_value(channel, shown, inch=indicator.inch)


class Mux10(Instrument):
    """A multiplexer with MUX-10 frames: answers a channel number with the value of its indicator."""

    at_end: ClassVar[bytes] = b"912\r"

    def answer(self, command: bytes) -> bytes:
        """A data frame or an error; nothing if the command is no channel number and not ``V``."""
        if command == b"V":
            return b"MUX-10F SIMULATED\r"
        if not command.isdigit():
            return b""
        indicator = self.indicators.get(int(command))
        return self._value(int(command)) if indicator and indicator.powered else b"911\r"

    @staticmethod
    def format_value(channel: int, value: float, *, inch: bool) -> bytes:
        """A data frame: eight characters of digits and point, the sign apart."""
        sign = b"-" if value < 0 else b"+"
        return b"0%dA%s%08.*f\r" % (channel, sign, 5 if inch else 3, abs(value))


class SingleIndicator(Instrument):
    """One indicator; silent while it is off."""

    value_request: ClassVar[bytes]

    def answer(self, command: bytes) -> bytes:
        """The value, or a setting."""
        indicator = self.indicators[1]
        if not indicator.powered:
            return b""
        return self._value(1) if command == self.value_request else self._setting(command, indicator)

    @abstractmethod
    def _setting(self, question: bytes, indicator: Indicator) -> bytes: ...


class Sylvac(SingleIndicator):
    """Sylvac's opto-RS duplex protocol."""

    baudrate: ClassVar[int] = 4800
    bits_a_byte: ClassVar[int] = 11
    value_request: ClassVar[bytes] = b"?"
    at_end: ClassVar[bytes] = b"ERR3\r"

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        """A micrometre or 10 microinches are the last digit."""
        return b"%+.*f\r" % (5 if inch else 3, value)

    def _setting(self, question: bytes, indicator: Indicator) -> bytes:
        answers = {
            b"UNI?": b"IN\r" if indicator.inch else b"MM\r",
            b"ID?": b"SY276\r",
            b"MOD?": b"NOR\r",
            b"STO?": b"STO0\r" if indicator.held_mm is None else b"STO1\r",
            b"CHA?": b"CHA-\r" if indicator.reversed else b"CHA+\r",
            b"PRE?": b"PRE +0.000\r",
            b"BAT?": b"BAT0\r" if indicator.battery_low else b"BAT1\r",
        }
        return answers.get(question, b"ERR1\r")


class Cdi(SingleIndicator):
    """The serial ASCII protocol of CDI and Starrett: the value, and parameters that can falsify it."""

    value_request: ClassVar[bytes] = b"R"
    at_end: ClassVar[bytes] = b"OUT OF BOUNDS\r\n"

    @staticmethod
    def format_value(_channel: int, value: float, *, inch: bool) -> bytes:
        """Sign, eight characters filled up with blanks, and the unit."""
        sign = b"-" if value < 0 else b"+"
        number = b"%8.*f" % (5 if inch else 4, abs(value))
        return sign + number + (b", IN\r\n" if inch else b", MM\r\n")

    def _setting(self, question: bytes, indicator: Indicator) -> bytes:
        parameters = {
            b"?p011": 0,
            b"?p013": 1 if indicator.inch else 2,
            b"?p019": int(indicator.reversed),
            b"?p021": int(indicator.held_mm is not None),
            b"?p040": 0,
        }
        return b"%d\r\n" % parameters[question] if question in parameters else b"NOT FOUND\r\n"


INSTRUMENTS: dict[str, type[Instrument]] = {"sylvac": Sylvac, "mux10": Mux10, "cdi": Cdi}
"""By the protocol in the cell file."""
