"""Instruments with SCPI in place of a dial indicator: conditioners of LVDTs, laser interferometers.

The section ``visa`` of the gauge says what is asked for a value, what a unit of it is, and which settings
the instrument must have. Numbers are those of SCPI-99, volume 1, 7.2.1: 9.9E37 is infinity, 9.91E37 is
none.
"""

from __future__ import annotations

import re
from functools import partial

from drivers.errors import WrongSetting
from drivers.gauges.plausibility import decimals_of
from drivers.gauges.protocol import (
    DisplayedValue,
    FrameRejected,
    GaugeState,
    LineSettings,
    ProtocolSpec,
    Unit,
)
from drivers.gauges.serial_gauge import SerialGauge
from drivers.gauges.visa_port import VisaPort
from drivers.serial.request_port import PortFactory
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError, FileError

IDENTIFY = b"*IDN?\n"
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d{1,3})?")
TEXT = re.compile(rb"[ -~]{1,200}")
INFINITE = 9.9e37
NO_NUMBER = 9.91e37


class VisaGauge(SerialGauge):
    """A length that an instrument with SCPI measures."""

    terminator = b"\n"
    port_factory: PortFactory = VisaPort

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        if settings.visa is None:
            raise FileError(
                "does not say what is asked",
                subject=self.subject,
                action="Add visa = { ask = ... } to the gauge",
            )
        self._visa = settings.visa
        self.channel = settings.channel if self._visa.has_channel else None
        self.value_request = self._visa.question(settings.channel).encode("latin-1") + b"\n"
        self._decimals = decimals_of(settings.resolution_mm or 0.001)
        self._spec = ProtocolSpec("visa", "instrument with SCPI", LineSettings(9600), "+1.23450000E-03\n")

    @property
    def spec(self) -> ProtocolSpec:  # type: ignore[override]
        """Of the instrument; its line is that of the cell file."""
        return self._spec

    def _line_settings(self) -> dict[str, object]:
        return {**self.settings.serial, "backend": self._visa.backend}

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        text = frame.strip().decode("latin-1")
        if not NUMBER.fullmatch(text):
            raise FrameRejected(frame)
        number = float(text)
        if abs(number) == NO_NUMBER:
            raise DeviceError(f"has no value ({text})", subject=self.subject, action="Look at its display")
        if abs(number) >= INFINITE:
            raise self._at_end(f"is out of its range ({text})")
        return DisplayedValue(number * self._visa.mm_per_unit, self._decimals, Unit.MM, text)

    async def _read_state(self) -> GaugeState:
        identification = await self._query(IDENTIFY, _text) if self._visa.identify else None
        for question, expected in self._visa.expect.items():
            answer = await self._query(question.encode("latin-1") + b"\n", partial(_setting, expected))
            if answer != expected:
                return GaugeState(identification, mode=f"{question} {answer}, not {expected}")
        return GaugeState(identification)

    def _unusable(self, state: GaugeState) -> WrongSetting | None:
        if state.mode is None:
            return None
        return self._wrong_setting(
            f"answers {state.mode}", "Set the instrument, or correct expect in the cell file"
        )


def _text(frame: bytes) -> str:
    text = frame.strip()
    if not TEXT.fullmatch(text):
        raise FrameRejected(frame)
    return text.decode("ascii")


def _setting(expected: str, frame: bytes) -> str:
    """A setting; numbers are compared as such."""
    text = _text(frame)
    if NUMBER.fullmatch(text) and NUMBER.fullmatch(expected) and float(text) == float(expected):
        return expected
    return text
