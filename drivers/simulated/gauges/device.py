"""The device on a simulated line."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from drivers.simulated.gauges.indicator import Indicator


class LineDevice(ABC):
    """An instrument, or a multiplexer with several, that answers commands.

    ``indicators`` are by channel, counted from 1; all but a multiplexer have channel 1 only.
    """

    baudrate: ClassVar[int] = 9600
    bits_a_byte: ClassVar[int] = 10  # with start, parity and stop bits

    def __init__(self, indicators: Mapping[int, Indicator]) -> None:
        self.indicators = dict(indicators)

    @abstractmethod
    def answer(self, command: bytes) -> bytes:
        """The answer to ``command``, which has no carriage return."""

    def power_up(self) -> bytes:
        """What it sends when it is switched on."""
        return b""


class SingleDevice(LineDevice):
    """A device with one indicator."""

    @property
    def indicator(self) -> Indicator:
        """Its indicator."""
        return self.indicators[1]

    def answer(self, command: bytes) -> bytes:
        """The answer to ``command``; nothing while it is off."""
        return self.reply(command) if self.indicator.powered else b""

    @abstractmethod
    def reply(self, command: bytes) -> bytes:
        """The answer while it is on."""
