"""Gauges that the cell file describes wholly, so that they need no driver of their own.

The section ``request`` of a gauge says what is asked, which answer is expected, and what a unit of its
number is; ``stream`` has the pattern of lines that a gauge sends by itself, where a group ``channel``
distinguishes several gauges on one port; ``modbus`` says in which registers a value stands.
"""

import re
import struct

from drivers.errors import WrongAnswer
from drivers.gauges.protocol import (
    DisplayedValue,
    FrameRejected,
    LineSettings,
    ProtocolSpec,
    Unit,
    decimals_of,
)
from drivers.gauges.serial_gauge import SerialGauge, ValueOnlyGauge
from drivers.gauges.streaming import Origin, StreamingGauge
from drivers.serial.modbus_port import FUNCTIONS, REQUEST, ModbusPort, wrong_frame
from drivers.serial.request_port import LINE_ENDS
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.described_devices import NUMBER, DescribedFrame
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError


class _DescribedGauge(SerialGauge):
    """A dial indicator, or what stands in its place, whose frames are ``frame`` of the cell file."""

    probe = None
    frame: DescribedFrame
    answer_check = "answer, protocol"

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        text = frame.strip(LINE_ENDS).decode("latin-1")
        if shown := self._shown(text):
            return shown
        if self._is_at_end(text):
            raise self._at_end(f"plunger at its end ({text})")
        raise FrameRejected(frame)

    def _shown(self, text: str) -> DisplayedValue | None:
        match = re.fullmatch(self.frame.answer, text)
        number = match[self.frame.number_group].replace(" ", "") if match else ""
        if not NUMBER.fullmatch(number):
            return None
        decimals = len(number.partition(".")[2]) + decimals_of(self.frame.mm_per_unit)
        if "E" in number.upper():  # such numbers have as many digits, not decimals, each time
            decimals = decimals_of(self.settings.resolution_mm or 0.001)
        return DisplayedValue(float(number) * self.frame.mm_per_unit, decimals, Unit.MM, text)

    def _is_at_end(self, text: str) -> bool:
        at_end = self.frame.at_end
        return at_end is not None and re.fullmatch(at_end, text) is not None


class RequestGauge(_DescribedGauge, ValueOnlyGauge):
    """A gauge by request and answer."""

    silence_check = "ask with its line end"

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        example = "request = { ask = ..., answer = ..., example = ... }"
        request = self._described(settings.request, "does not say what is asked and answered", example)
        self.frame = request
        self.spec = ProtocolSpec("request", "gauge by request", LineSettings(9600), request.example)  # type: ignore[misc]
        self.terminator = request.ends_with.encode("latin-1")
        self.value_request = request.ask.encode("latin-1")


class StreamGauge(_DescribedGauge, StreamingGauge):
    """A gauge that sends unasked."""

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        example = "stream = { answer = ..., example = ... }"
        stream = self._described(settings.stream, "does not say what it sends", example)
        self.frame = self._stream = stream
        self.spec = ProtocolSpec("stream", "gauge that sends", LineSettings(9600), stream.example)  # type: ignore[misc]
        self.channel = settings.channel if stream.has_channel else None

    def _line_settings(self) -> dict[str, object]:
        end = self._stream.ends_with
        return super()._line_settings() | ({} if end is None else {"frame_end": end.encode("latin-1")})

    def _origin(self, frame: bytes) -> Origin:
        text = frame.decode("latin-1")
        if self._is_at_end(text):
            return Origin.OWN
        if (match := re.fullmatch(self.frame.answer, text)) is None:
            return Origin.UNKNOWN
        if self.channel is None:
            return Origin.OWN
        channel = match["channel"]
        if not channel.isdecimal():
            return Origin.UNKNOWN
        return Origin.OWN if int(channel) == self.channel else Origin.ANOTHER_GAUGE


FORMATS = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}
WORD = 2


class ModbusGauge(ValueOnlyGauge):
    """A number in the registers of a device with Modbus RTU; several may share a line.

    The section ``modbus`` of the gauge says where it is and what a count of it is. Frames have a CRC-16; a
    late answer looks like that to the next request, so the line is silent for a while after a time-out.
    """

    terminator = b""
    port_factory, silence_check = ModbusPort, "device"
    probe = None
    spec = ProtocolSpec("modbus", "Modbus register", LineSettings(19200, parity="E"), "00 01 86 a0")

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        example = "modbus = { register = ... }"
        self._modbus = self._described(settings.modbus, "does not say in which register it is", example)
        self._format = struct.Struct(FORMATS[self._modbus.type])
        self.channel = settings.place_on_line
        self.value_request = REQUEST.pack(
            self._modbus.device,
            FUNCTIONS[self._modbus.kind],
            self._modbus.register_,
            self._format.size // WORD,
        )
        is_float = self._modbus.type == "float32"
        last_digit = (settings.resolution_mm or 0.001) if is_float else self._modbus.mm_per_unit
        self._decimals = decimals_of(last_digit)

    def _garbled(self, received: bytes) -> DeviceError:
        what, action = wrong_frame(received, self._modbus.device)
        return self._error(WrongAnswer, f"answers {what}", action)

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        if len(frame) != self._format.size:
            raise FrameRejected(frame)
        is_little = self._modbus.word_order == "little"
        [number] = self._format.unpack(frame[WORD:] + frame[:WORD] if is_little else frame)
        if number in self._modbus.at_end:
            raise self._at_end(f"shows {number}, as at an end of its travel")
        text = f"{frame.hex(' ', WORD)} = {number:g}"
        return DisplayedValue(number * self._modbus.mm_per_unit, self._decimals, Unit.MM, text)
