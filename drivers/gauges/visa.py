"""Instruments with SCPI in place of a dial indicator: conditioners of LVDTs, laser interferometers.

The section ``visa`` of the gauge says what is asked for a value, what a unit of it is, and which settings
the instrument must have. Numbers are those of SCPI-99, volume 1, 7.2.1: 9.9E37 is infinity, 9.91E37 is
no number.
"""

from __future__ import annotations

import re
import termios
import time
from contextlib import suppress
from functools import cached_property, partial
from typing import Any

from drivers.errors import PortLost, WrongSetting
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
from drivers.libraries import optional
from drivers.serial.framing import FRAME_LIMIT
from drivers.serial.opening import SLICE_S, lost_port
from drivers.serial.request_port import NoAnswer, RequestPort
from drivers.serial.shared_port import SharedSerialPorts
from drivers.wire_trace import TrafficDirection
from hexacell.cell.devices import GaugeSettings
from hexacell.errors import DeviceError

EXTRA = "visa"
PURE_PYTHON = "@py"
MS = 1000.0
SURPLUS_S = 0.002
FRAME_GAP_S = 0.04
BYTE_STREAMS = ("::SOCKET", "ASRL")
SERIAL = "ASRL"
LINE_ATTRIBUTES = {"baudrate": "baud_rate", "bytesize": "data_bits"}
PARITIES = {"N": "none", "E": "even", "O": "odd", "M": "mark", "S": "space"}
STOP_BITS = {1: "one", 1.5: "one_and_a_half", 2: "two"}
IDENTIFY = b"*IDN?\n"
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d{1,3})?")
TEXT = re.compile(rb"[ -~]{1,200}")
INFINITE = 9.9e37
NO_NUMBER = 9.91e37


class VisaPort(RequestPort):
    """One VISA resource; ``settings`` are ``backend`` and, of a serial one, those of the line.

    Sockets and serial lines are read byte by byte, so that closing never waits long, and are silent for
    ``worst_latency_s`` after a time-out before the next request. Others (USB, LAN, GPIB) carry whole
    messages: they are read with the time-out at once, and cleared after one.
    """

    _resource: Any = None
    _visa: Any = None
    _gap_s = SURPLUS_S

    @cached_property
    def _is_stream(self) -> bool:
        return any(word in self.url.upper() for word in BYTE_STREAMS)

    def open(self) -> int:
        """Open the resource unless it is open; how often it has been opened."""
        self.require_not_closed()
        if self._resource is None:
            self._visa = optional("pyvisa", EXTRA, self.subject)
            self._resource = self._opened()
            self.open_count += 1
            self._must_clear = False
        return self.open_count

    def exchange(self, request: bytes, terminator: bytes, timeout_s: float) -> bytes:
        """Send ``request``; its answer up to ``terminator``."""
        self.require_not_closed()
        if self._resource is None:
            raise lost_port(self.subject, self.url, "it is not open", "Connect it")
        try:
            if self._must_clear:
                self._clear()
            elif self._is_stream:
                self._drop_surplus()
            self._record(TrafficDirection.SENT, request)
            self._resource.timeout = MS * timeout_s  # of writing too
            self._resource.write_raw(request)
            return self._answer(terminator, timeout_s)
        except (OSError, termios.error, self._visa.errors.Error) as error:
            self.close()
            raise lost_port(self.subject, self.url, str(error), "Connect it") from error

    def close(self) -> None:
        """Close the resource; closing twice is harmless."""
        resource, self._resource = self._resource, None
        if resource is not None:
            with suppress(Exception):  # it may be gone already
                resource.close()

    def _opened(self) -> Any:  # noqa: ANN401 - of a library that may be missing
        try:
            backend = str(self._settings.get("backend", PURE_PYTHON))
            resource = self._visa.ResourceManager(backend).open_resource(self.url)
            if self.url.upper().startswith(SERIAL):
                self._set_line(resource)
        except Exception as error:  # its backends raise anything, also Exception itself
            raise PortLost(
                f"port {self.url} cannot be opened: {error}",
                subject=self.subject,
                action="Check the instrument and port in the cell file",
            ) from error
        return resource

    def _set_line(self, resource: Any) -> None:  # noqa: ANN401
        constants = self._visa.constants
        given: dict[str, Any] = {**self._settings}
        for name, attribute in LINE_ATTRIBUTES.items():
            if name in given:
                setattr(resource, attribute, given[name])
        if "parity" in given:
            resource.parity = constants.Parity[PARITIES[given["parity"]]]
        if "stopbits" in given:
            resource.stop_bits = constants.StopBits[STOP_BITS[given["stopbits"]]]
        resource.end_input = constants.SerialTermination.none

    def _answer(self, terminator: bytes, timeout_s: float) -> bytes:
        received = b""
        deadline_s = time.monotonic() + timeout_s
        while not received.endswith(terminator):
            if time.monotonic() > deadline_s or len(received) > FRAME_LIMIT:
                self._must_clear = True
                raise NoAnswer(received)
            received += self._some(timeout_s).lstrip(b"\r\n\0" if not received else b"")
        return received

    def _some(self, timeout_s: float) -> bytes:
        """A byte of a stream, or a message; nothing if none comes in time."""
        self.require_not_closed()
        self._resource.timeout = MS * (min(SLICE_S, timeout_s) if self._is_stream else timeout_s)
        try:
            data: bytes = self._resource.read_bytes(1) if self._is_stream else self._resource.read_raw()
        except self._visa.errors.VisaIOError as error:
            if error.error_code == self._visa.constants.StatusCode.error_timeout:
                return b""
            raise
        self._record(TrafficDirection.RECEIVED, data)
        return data

    def _clear(self) -> None:
        """Let late answers come and go."""
        if not self._is_stream:
            self._resource.clear()
        quiet_from_s = time.monotonic()
        give_up_s = quiet_from_s + 5 * self._worst_latency_s
        while self._is_stream and time.monotonic() < quiet_from_s + self._worst_latency_s:
            if self._some(SLICE_S):
                quiet_from_s = time.monotonic()
                self.surplus_count += 1
            if quiet_from_s > give_up_s:
                raise DeviceError(f"the device on {self.url} keeps sending unasked", subject=self.subject)
        self._must_clear = False

    def _drop_surplus(self) -> None:
        """Drop what came after the last answer.

        After the first such bytes every question waits until the line is silent.
        """
        received = False
        while self._some(self._gap_s):
            received = True
        if received and self._gap_s < FRAME_GAP_S:
            self.surplus_count += 1
            self._gap_s = FRAME_GAP_S


class VisaGauge(SerialGauge):
    """A length that an instrument with SCPI measures."""

    spec = ProtocolSpec("visa", "instrument with SCPI", LineSettings(9600), "+1.23450000E-03\n")
    probe = None
    terminator = b"\n"
    port_factory = VisaPort

    def __init__(self, settings: GaugeSettings, ports: SharedSerialPorts) -> None:
        super().__init__(settings, ports)
        self._visa = self._described(settings.visa, "does not say what is asked", "visa = { ask = ... }")
        self.channel = settings.channel if self._visa.has_channel else None
        self.value_request = self._visa.question(settings.channel).encode("latin-1") + b"\n"
        self._decimals = decimals_of(settings.resolution_mm or 0.001)

    def _line_settings(self) -> dict[str, object]:
        return {**self.settings.serial, "backend": self._visa.backend}

    def _parse_value(self, frame: bytes) -> DisplayedValue:
        text = frame.strip().decode("latin-1")
        if not NUMBER.fullmatch(text):
            raise FrameRejected(frame)
        number = float(text)
        if abs(number) == NO_NUMBER:
            raise self._error(DeviceError, f"has no value ({text})", "Look at its display")
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
        action = "Set the instrument, or correct expect in the cell file"
        return self._error(WrongSetting, f"answers {state.mode}", action)


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
