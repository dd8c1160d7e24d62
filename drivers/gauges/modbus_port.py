"""A line with Modbus RTU as one with requests and answers; all calls come from one thread.

pymodbus is imported when such a line is opened. A request is the device and the PDU as on the wire, without
its checksum; an answer is the registers. No call takes longer than the time-out.
"""

from __future__ import annotations

import logging
import struct
import termios
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

from drivers.errors import PortLost
from drivers.extras import optional
from drivers.serial.errors import lost_port
from drivers.serial.port import SLICE_S, NoAnswer
from drivers.serial.request_port import LibraryPort
from drivers.wire_trace import TraceRecorder, TrafficDirection
from hexacell.errors import DeviceError

EXTRA = "modbus"
REQUEST = struct.Struct(">BBHH")
HOLDING, INPUT = 3, 4
EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    6: "device busy",
}
OPEN_TRIES = 20
LINE_KEYS = ("baudrate", "bytesize", "parity", "stopbits")

# Failures are raised as errors; without a handler pymodbus would also print them.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())


class ModbusPort(LibraryPort):
    """One serial line with Modbus devices; ``settings`` are those of the line."""

    def __init__(
        self,
        url: str,
        settings: Mapping[str, object],
        closing: threading.Event,
        recorder: TraceRecorder | None = None,
        worst_latency_s: float = 2.0,
    ) -> None:
        super().__init__(url, settings, closing, recorder, worst_latency_s)
        self._line: dict[str, Any] = {name: settings[name] for name in LINE_KEYS if name in settings}
        self._client: Any = None
        self._modbus: Any = None
        self._received = b""

    def open(self) -> int:
        """Open the line unless it is open; how often it has been opened.

        Raises:
            UsageError: pymodbus is not installed.
            PortLost: the line cannot be opened.
        """
        self.require_not_closed()
        if self._client is None:
            self._modbus = optional("pymodbus", EXTRA, self.subject)
            client = optional("pymodbus.client", EXTRA, self.subject).ModbusSerialClient(
                self.url, retries=0, trace_packet=self._note, **self._line
            )
            if not self._connects(client):
                raise PortLost(
                    f"port {self.url} cannot be opened",
                    subject=self.subject,
                    action="Plug it in, close other programs that use it, or correct port in the cell file",
                )
            self._client = client
            self.open_count += 1
            self._must_clear = False
        return self.open_count

    def _connects(self, client: Any) -> bool:  # noqa: ANN401 - of a library that may be missing
        """Whether it opens; a pseudo-terminal refuses parity until its server has reset its speed."""
        for _ in range(OPEN_TRIES):
            if client.connect():
                return True
            self._closing.wait(SLICE_S)
            self.require_not_closed()
        return False

    def exchange(self, request: bytes, _terminator: bytes, timeout_s: float) -> bytes:
        """Read registers; see the head of this file.

        Raises:
            NoAnswer: none came in time, or a damaged one.
            DeviceError: the device answers with an exception.
            PortLost: the line is not open, or was lost.
        """
        self.require_not_closed()
        if self._client is None:
            raise lost_port(self.subject, self.url, "it is not open")
        device, function, address, count = REQUEST.unpack(request)
        client, self._received = self._client, b""
        client.comm_params.timeout_connect = timeout_s
        read = client.read_holding_registers if function == HOLDING else client.read_input_registers
        with self._port_errors():
            if self._must_clear:
                self._clear()
            answer = read(address, count=count, device_id=device)
        if answer.isError():
            raise self._refused(device, answer.exception_code)
        if len(answer.registers) != count:
            raise NoAnswer(self._received)
        return struct.pack(f">{count}H", *answer.registers)

    def close(self) -> None:
        """Close the line; closing twice is harmless."""
        client, self._client = self._client, None
        if client is not None:
            with suppress(OSError, termios.error):
                client.close()

    def _clear(self) -> None:
        """Let late answers come and go: they look like those to the next request."""
        self._closing.wait(self._worst_latency_s)
        self.require_not_closed()
        if self._client.socket is not None:
            self._client.socket.reset_input_buffer()
        self._must_clear = False

    def _note(self, sending: bool, data: bytes) -> bytes:
        new = data if sending else data.removeprefix(self._received)  # all since the request comes
        if not sending:
            self._received = data
        self._record(TrafficDirection.SENT if sending else TrafficDirection.RECEIVED, new)
        return data

    @contextmanager
    def _port_errors(self) -> Iterator[None]:
        try:
            yield
        except self._modbus.exceptions.ModbusIOException as error:
            self._must_clear = True
            raise NoAnswer(self._received) from error
        except (OSError, termios.error, self._modbus.exceptions.ModbusException) as error:
            self.close()
            raise lost_port(self.subject, self.url, str(error)) from error

    def _refused(self, device: int, code: int) -> DeviceError:
        return DeviceError(
            f"device {device} answers exception {code} ({EXCEPTIONS.get(code, 'of its maker')})",
            subject=self.subject,
            action="Correct device, kind and register in [gauges.modbus]",
        )
