"""Gauges whose value stands in the registers of a device with Modbus RTU."""

from __future__ import annotations

import struct

from drivers.errors import WrongAnswer
from drivers.gauges.plausibility import decimals_of
from drivers.gauges.protocol import DisplayedValue, FrameRejected, LineSettings, ProtocolSpec, Unit
from drivers.gauges.serial_gauge import ValueOnlyGauge
from drivers.serial.modbus_port import FUNCTIONS, REQUEST, ModbusPort
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError

FORMATS = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}
WORD = 2


class ModbusGauge(ValueOnlyGauge):
    """A number in the registers of a device with Modbus RTU; several may share a line.

    The section ``modbus`` of the gauge says where it is and what a count of it is. Frames have a CRC-16; a
    late answer looks like that to the next request, so the line is silent for a while after a time-out.
    """

    terminator = b""
    port_factory = ModbusPort
    probe = None
    spec = ProtocolSpec("modbus", "Modbus register", LineSettings(19200, parity="E"), "00 01 86 a0")

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        self._modbus = self._described(
            settings.modbus, "does not say in which register it is", "modbus = { register = ... }"
        )
        self._format = struct.Struct(FORMATS[self._modbus.type])
        self.channel = settings.place_on_line
        self.value_request = REQUEST.pack(
            self._modbus.device,
            FUNCTIONS[self._modbus.kind],
            self._modbus.register_,
            self._format.size // WORD,
        )
        resolution = settings.resolution_mm or 0.001
        self._decimals = decimals_of(
            resolution if self._modbus.type == "float32" else self._modbus.mm_per_unit
        )

    def _garbled(self, received: bytes) -> DeviceError:
        action = "Check its cable, and its baud rate and parity against serial in the cell file"
        return self._error(
            WrongAnswer, f"answers {received!r}, no single frame with a right checksum", action
        )

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if len(frame) != self._format.size:
            raise FrameRejected(frame)
        words = [frame[start : start + WORD] for start in range(0, len(frame), WORD)]
        if self._modbus.word_order == "little":
            words.reverse()
        [number] = self._format.unpack(b"".join(words))
        if number in self._modbus.at_end:
            raise self._at_end(f"shows {number}, as at an end of its travel")
        if number != number:  # noqa: PLR0124 - what is no number differs from itself
            raise FrameRejected(frame)
        text = f"{frame.hex(' ', WORD)} = {number:g}"
        return DisplayedValue(number * self._modbus.mm_per_unit, self._decimals, Unit.MM, text)
