"""A simulated receiver of indicators with radio transmitters, in their event-driven mode."""

from __future__ import annotations

from typing import ClassVar

from drivers.simulated.gauges.instruments import Instrument


class Uwave(Instrument):
    """Mitutoyo's U-WAVE-R: what an indicator does not show is not sent."""

    baudrate: ClassVar[int] = 57600
    period_s: ClassVar[float | None] = 0.05
    at_end: ClassVar[bytes] = b""

    def answer(self, command: bytes) -> bytes:
        """None: the commands of its own program are not simulated."""
        del command
        return b""

    @staticmethod
    def format_value(channel: int, value: float, *, inch: bool) -> bytes:
        """A frame of one transmitter; a status line now and then is ignored by readers."""
        unit, decimals = (b"I", 5) if inch else (b"M", 3)
        sign = b"-" if value < 0 else b"+"
        return b"DT1%04d%s%011.*f%s\r" % (channel, sign, decimals, abs(value), unit)
