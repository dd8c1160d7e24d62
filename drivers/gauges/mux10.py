"""Mitutoyo MUX-10 frames: one of several indicators behind a multiplexer.

Line 9600 8N1. The channel number requests its value: ``0``, channel, ``A``, sign, eight characters of
digits and point. An error is three digits beginning with 9: the last is 1 if no gauge answered, 8 if the
multiplexer is busy. The second is 1 in the sources seen; the channel is accepted too. Nothing says the
unit: five decimals are inches, unless the cell file states such a resolution. Hold, direction and preset
cannot be asked for.
"""

import asyncio
import re
from contextlib import suppress
from dataclasses import replace

from drivers.errors import EmptyChannel, GaugeSilent, WrongAnswer
from drivers.gauges import protocol
from drivers.gauges.serial_gauge import ValueOnlyGauge
from drivers.interfaces import GaugeReading
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError

VALUE_FRAME = re.compile(rb"0(\d{1,2})A([+-])(?=.{8}\r)(\d+\.\d+)\r")
ERROR_FRAME = re.compile(rb"9(\d)(\d)\r")
IDENTIFICATION_FRAME = re.compile(rb"([ -~]{4,60})\r")
NO_GAUGE = 1
BUSY = 8
BUSY_TRIES = 20
BUSY_ACTION = "Disconnect the foot switch and other triggers"


class MultiplexerBusy(Exception):
    """Error 918: repeat the request after a pause."""


def parse_identification(frame: bytes) -> str:
    """The identification of the multiplexer, which is free text.

    Raises:
        FrameRejected: It is no text of a plausible length, or it is a value.
    """
    match = IDENTIFICATION_FRAME.fullmatch(frame)
    if match is None or VALUE_FRAME.fullmatch(frame):
        raise protocol.FrameRejected(frame)
    return match[1].decode("ascii").strip()


class Mux10Gauge(ValueOnlyGauge):
    """A dial indicator on one channel of a Mitutoyo MUX-10 or a multiplexer with its format."""

    spec = protocol.ProtocolSpec(
        "mux10", "Mitutoyo MUX-10 channel", protocol.LineSettings(9600), "01A+0000.123\r", 5
    )
    probe = protocol.Probe((19200, 4800, 2400, 38400, 57600, 115200))
    has_channels = True
    busy_pause_s = 0.05

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        self.value_request = b"%d\r" % settings.channel

    async def read_once(self) -> GaugeReading:
        """The value displayed at this moment, mm; a busy multiplexer counts as a garbled answer."""
        try:
            return await super().read_once()
        except MultiplexerBusy:
            raise self._error(WrongAnswer, "its multiplexer is busy (918)", BUSY_ACTION) from None

    async def _read_value(self) -> protocol.DisplayedValue:
        for _ in range(BUSY_TRIES):
            try:
                return await super()._read_value()
            except MultiplexerBusy:
                await asyncio.sleep(self.busy_pause_s)
        raise self._error(DeviceError, "its multiplexer stays busy (918)", BUSY_ACTION)

    def _parse_value(self, frame: bytes) -> protocol.DisplayedValue:
        value = VALUE_FRAME.fullmatch(frame)
        if value and int(value[1]) == self.channel:
            return protocol.DisplayedValue.of(value[2], value[3], frame)
        error = ERROR_FRAME.fullmatch(frame)
        if error is None or int(error[1]) not in {1, self.channel}:
            raise protocol.FrameRejected(frame)
        code, displayed = int(error[2]), frame.decode("ascii").strip()
        if code == BUSY:
            raise MultiplexerBusy
        if code == NO_GAUGE:
            action = "Switch it on, check its cable, and channel in the cell file"
            raise self._error(EmptyChannel, f"does not answer its multiplexer ({displayed})", action)
        raise self._at_end(f"shows an error instead of a value ({displayed}), as at an end of its travel")

    async def _read_state(self) -> protocol.GaugeState:
        state = await super()._read_state()
        if self._state is not None:
            return replace(state, identification=self._state.identification)
        with suppress(GaugeSilent, WrongAnswer):
            return replace(state, identification=await self._query(b"V\r", parse_identification))
        return state
