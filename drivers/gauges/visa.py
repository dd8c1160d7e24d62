"""Instruments with SCPI in place of a dial indicator: conditioners of LVDTs, laser interferometers.

The section ``visa`` of the gauge says what is asked for a value, what a unit of it is, and which settings
the instrument must have. Numbers are those of SCPI-99, volume 1, 7.2.1: 9.9E37 is infinity, 9.91E37 is
no number.
"""

import re
import termios
from contextlib import suppress
from functools import partial
from typing import Any

from drivers.errors import PortLost, WrongSetting, optional
from drivers.gauges import protocol
from drivers.gauges.serial_gauge import SerialGauge
from drivers.serial.opening import lost_port
from drivers.serial.port import SerialPort
from drivers.serial.request_port import NoAnswer, RequestPort
from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import TrafficDirection
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError

SOCKET = re.compile(r"TCPIP\d*::(?P<host>[^:]+)::(?P<port>\d+)::SOCKET", re.IGNORECASE)
SERIAL = re.compile(r"ASRL(?P<port>.+?)(?:::INSTR)?", re.IGNORECASE)
IDENTIFY = b"*IDN?"
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d{1,3})?")
TEXT = re.compile(rb"[ -~]{1,200}")
INFINITE = 9.9e37
NO_NUMBER = 9.91e37


def line_to(resource: str) -> tuple[type[RequestPort], str]:
    """The line to a VISA resource, and its address: pyserial's where it is a stream of bytes.

    A serial resource with a number is named as VISA libraries do on Linux: ``ASRL1`` is ``/dev/ttyS0``.
    """
    if match := SOCKET.fullmatch(resource):
        return SerialPort, f"socket://{match['host']}:{match['port']}"
    if match := SERIAL.fullmatch(resource):
        port = match["port"]
        return SerialPort, f"/dev/ttyS{int(port) - 1}" if port.isdecimal() else port
    return VisaPort, resource


class VisaPort(RequestPort):
    """One VISA resource that carries whole messages (USB, LAN, GPIB); ``settings`` is its ``backend``.

    A message is awaited for the whole time-out at once. The resource is cleared after none came in time.
    """

    _resource: Any = None
    _visa: Any = None

    def open(self) -> int:
        """Open the resource unless it is open; how often it has been opened."""
        self.require_not_closed()
        if self._resource is None:
            self._visa = optional("pyvisa", "visa", self.subject)
            backend = str(self._settings.get("backend", "@py"))
            try:
                self._resource = self._visa.ResourceManager(backend).open_resource(self.url)
            except Exception as error:  # its backends raise anything, also Exception itself
                is_library = re.search("install|library|wrapper", str(error), re.IGNORECASE)
                check = "Install what it names, or correct" if is_library else "Check it, its rights and"
                raise PortLost(
                    f"port {self.url} cannot be opened: {error}",
                    subject=self.subject,
                    action=f"{check} port in the cell file",
                ) from error
            self._opened()
            self._must_clear = False
        return self.open_count

    def _exchange_once(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request``; its answer, which ends with ``terminator``."""
        self.require_not_closed()
        if self._resource is None:
            raise lost_port(self.subject, self.url, "it is not open", "Connect it")
        try:
            if self._must_clear:
                self._resource.clear()
                self._must_clear = False
            self._record(TrafficDirection.SENT, request)
            self._resource.timeout = 1000.0 * timeout_s  # ms, of writing too
            self._resource.write_raw(request)
            received = self._message()
        except (OSError, termios.error, self._visa.errors.Error) as error:
            self.close()
            raise lost_port(self.subject, self.url, str(error), "Connect it") from error
        if not received.endswith(terminator):
            self._must_clear = True
            raise NoAnswer(received, request)
        return received

    def close(self) -> None:
        """Close the resource; closing twice is harmless."""
        resource, self._resource = self._resource, None
        if resource is not None:
            with suppress(Exception):  # it may be gone already
                resource.close()

    def _message(self) -> bytes:
        """A message; nothing if none comes in time."""
        try:
            data: bytes = self._resource.read_raw()
        except self._visa.errors.VisaIOError as error:
            if error.error_code == self._visa.constants.StatusCode.error_timeout:
                return b""
            raise
        self._record(TrafficDirection.RECEIVED, data)
        return data.lstrip(b"\r\n\0")


class VisaGauge(SerialGauge):
    """A length that an instrument with SCPI measures."""

    spec = protocol.ProtocolSpec(
        "visa", "instrument with SCPI", protocol.LineSettings(9600), "+1.23450000E-03\n"
    )
    probe = None
    terminator = b"\n"
    silence_check = "ask with its line_end"

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        if settings.port is not None:
            self.port_factory, address = line_to(settings.port)
            settings = settings.model_copy(update={"port": address})
        super().__init__(settings, ports)
        self._visa = self._described(settings.visa, "does not say what is asked", "visa = { ask = ... }")
        self.channel = settings.channel if self._visa.has_channel else None
        self._line_end = self._visa.line_end.encode("latin-1")
        self.terminator = self._line_end[-1:]
        self.value_request = self._visa.question(settings.channel).encode("latin-1") + self._line_end
        self._decimals = protocol.decimals_of(settings.resolution_mm or 0.001)

    def _line_settings(self) -> dict[str, object]:
        is_stream = self.port_factory is SerialPort
        return super()._line_settings() if is_stream else {"backend": self._visa.backend}

    def _parse_value(self, frame: bytes) -> protocol.DisplayedValue:
        text = frame.strip().decode("latin-1")
        if not NUMBER.fullmatch(text):
            raise protocol.FrameRejected(frame)
        number = float(text)
        if abs(number) == NO_NUMBER:
            raise self._error(DeviceError, f"has no value ({text})", "Look at its display")
        if abs(number) >= INFINITE:
            raise self._at_end(f"is out of its range ({text})")
        return protocol.DisplayedValue(
            number * self._visa.mm_per_unit, self._decimals, protocol.Unit.MM, text
        )

    async def _read_state(self) -> protocol.GaugeState:
        asked = IDENTIFY + self._line_end
        identification = await self._query(asked, _text) if self._visa.identify else None
        for question, expected in self._visa.expect.items():
            query = question.encode("latin-1") + self._line_end
            answer = await self._query(query, partial(_setting, expected))
            if answer != expected:
                return protocol.GaugeState(identification, mode=f"{question} {answer}, not {expected}")
        return protocol.GaugeState(identification)

    def _unusable(self, state: protocol.GaugeState) -> WrongSetting | None:
        if state.mode is None:
            return None
        action = "Set the instrument, or correct expect in the cell file"
        return self._error(WrongSetting, f"answers {state.mode}", action)


def _text(frame: bytes) -> str:
    text = frame.strip()
    if not TEXT.fullmatch(text):
        raise protocol.FrameRejected(frame)
    return text.decode("ascii")


def _setting(expected: str, frame: bytes) -> str:
    """A setting; numbers are compared as such."""
    text = _text(frame)
    if NUMBER.fullmatch(text) and NUMBER.fullmatch(expected) and float(text) == float(expected):
        return expected
    return text
