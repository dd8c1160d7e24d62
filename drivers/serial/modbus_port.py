"""A line with Modbus RTU as one with requests and answers; all calls come from one thread.

pymodbus is imported when such a line is opened. A request is the device and the PDU as on the wire, without
its checksum; an answer is the registers. No call takes longer than the time-out.
"""

import logging
import struct
import termios
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from typing import Any

from drivers.errors import PAUSE_S, TIMES_ASKED, optional
from drivers.serial.opening import SLICE_S, lost_port, opened_port, sent
from drivers.serial.received import is_text, quoted
from drivers.serial.request_port import NoAnswer, RequestPort, is_copies
from drivers.wire_trace import TrafficDirection
from hexacell.clock import Patience
from hexacell.errors import DeviceError

REQUEST = struct.Struct(">BBHH")
HOLDING, INPUT = 3, 4
FUNCTIONS = {"holding": HOLDING, "input": INPUT}
"""By the kind of a register in the cell file."""

BROADCAST = 0
NUL = b"\0"
"""Real lines send some before a frame, and no device has this address."""
ADDRESS_AND_CHECKSUM, EXCEPTION = 3, 0x80
FRAME_BYTES, REGISTER_BYTES = 5, 2
"""Bytes of an answer without registers (device, function, length, checksum), and of each register."""

EXCEPTIONS = {
    "Correct device, kind and register in the cell file": {
        1: "illegal function",
        2: "illegal data address",
        3: "illegal data value",
    },
    "Switch it off and on": {4: "device failure", 8: "memory parity error"},
    "End other programs that ask it": {5: "acknowledged, takes long", 6: "device busy"},
    "Check the device behind its gateway": {
        10: "no path through the gateway",
        11: "no answer to the gateway",
    },
}
"""What a device answers in place of registers, by what to do (Modbus Application Protocol 7)."""
NOT_THERE, BUSY = (2, 3), (5, 6)
"""Those that mean that there are no such registers, or not so many in one answer; those that pass."""
LINE_KEYS = ("baudrate", "bytesize", "parity", "stopbits")

# Failures are raised as errors; without a handler pymodbus would also print them.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())


def wrong_frame(received: bytes, device: int) -> tuple[str, str]:
    """What came in place of one frame of a device, as far as the bytes tell, and what to do."""
    check = "its cable, and its baud rate and parity against serial in the cell file"
    if not received:
        return "only the echo of the request", f"Switch the device on, check its address and {check}"
    if is_text(received):
        what = "Modbus ASCII" if received.startswith(b":") else "text, no Modbus"
        return f"{what}: {quoted(received)}", "Set it to Modbus RTU, or correct port in the cell file"
    checksum = import_module("pymodbus.framer").FramerRTU.compute_CRC(received[:-2])
    if len(received) > ADDRESS_AND_CHECKSUM and checksum == int.from_bytes(received[-2:]):
        if received[0] == device:
            action = "End other programs that ask it, and correct register, kind and type in the cell file"
            return f"a whole frame that does not answer the request: {received.hex(' ')}", action
        action = "Correct device, or devices, in the cell file, and give each device on the line its own"
        return f"a frame of device {received[0]}, not {device}", action
    what = f"{quoted(received)}, no single frame with a right checksum"
    return what, f"Check {check}, and that no other device has its address"


class RefusedRequest(DeviceError):
    """A device answers that it cannot do what it is asked; ``is_absence``: it has no such registers."""

    is_absence = False


class ModbusPort(RequestPort):
    """One serial line with Modbus devices; ``settings`` are those of the line."""

    _client: Any = None
    _modbus: Any = None
    _received = _frame = _sent = b""

    def open(self) -> int:
        """Open the line unless it is open; how often it has been opened."""
        self.require_not_closed()
        if self._client is None:
            line: dict[str, Any] = {one: self._settings[one] for one in LINE_KEYS if one in self._settings}
            self._modbus = optional("pymodbus", "modbus", self.subject)
            client = optional("pymodbus.client", "modbus", self.subject).ModbusSerialClient(
                self.url, retries=0, trace_packet=self._note, **line
            )
            # Not by its own connect(), which gives no cause and configures a pseudo-terminal twice.
            port: Any = opened_port(
                self.url, line, self.subject, self.closing, client.inter_byte_timeout or None
            )
            port.write = partial(sent, port.write)
            client.socket, client.recv = port, self._next_bytes
            self._client = client
            self._opened()
            self._must_clear = False
        return self.open_count

    def _exchange_once(self, request: bytes, _terminator: bytes, timeout_s: float) -> bytes:
        """Read registers; a device that answers with an exception, not busy, is a ``RefusedRequest``."""
        device, function, address, count = REQUEST.unpack(request)
        for _ in range(TIMES_ASKED):
            self._received = b""
            with self._requesting() as client:
                client.comm_params.timeout_connect = timeout_s
                read = client.read_holding_registers if function == HOLDING else client.read_input_registers
                answer = read(address, count=count, device_id=device)
            if answer.function_code & ~EXCEPTION != function:
                self._must_clear = True
                raise NoAnswer(self._received, self._sent)
            if not (answer.isError() and answer.exception_code in BUSY):
                break
            self.closing.wait(PAUSE_S)
        if answer.isError():
            code = answer.exception_code
            known = ((action, words[code]) for action, words in EXCEPTIONS.items() if code in words)
            action, words = next(known, ("Switch it off and on", "of its maker"))
            refused = RefusedRequest(
                f"device {device} answers exception {code} ({words})",
                subject=self.subject,
                action=f"{action}, or look it up in its manual",
            )
            refused.is_absence = code in NOT_THERE
            raise refused
        if len(answer.registers) != count or not self._is_alone(FRAME_BYTES + REGISTER_BYTES * count):
            self._must_clear = True  # one of several frames, of which nobody knows which is the answer
            raise NoAnswer(self._received, self._sent)
        return struct.pack(f">{count}H", *answer.registers)

    def write_to_all(self, register: int, value: int) -> None:
        """Write a register of all devices at once, which none of them answers."""
        with self._requesting() as client:
            client.write_register(register, value, device_id=BROADCAST, no_response_expected=True)

    def close(self) -> None:
        """Close the line; closing twice is harmless."""
        client, self._client = self._client, None
        if client is not None:
            with suppress(OSError, termios.error):
                client.close()

    def _next_bytes(self, _size: int | None) -> bytes:
        """What comes until the line pauses; nothing if nothing comes in time.

        The echo of the request, which adapters for two wires send, is no answer yet.
        """
        port, received = self._client.socket, b""
        patience = Patience(self._client.comm_params.timeout_connect, SLICE_S, time.monotonic())
        while patience.left_s(time.monotonic()) > 0.0:
            self.require_not_closed()
            if new := port.read(count) if (count := port.in_waiting) else b"":
                received += new
            elif not self._sent.startswith(received):
                break
            time.sleep(self._client._recv_interval)
        return received

    def _is_alone(self, frame_bytes: int) -> bool:
        """Whether what came is one frame, or copies of it, which some adapters send."""
        frames = self._received.removeprefix(self._sent).lstrip(NUL)
        self._frame = frames[:frame_bytes]
        return is_copies(frames, self._frame)

    def _drop_surplus(self) -> None:
        """What came after an answer makes that doubtful, unless it is a copy of it."""
        port = self._client.socket
        if port is not None and port.in_waiting:
            surplus = port.read(port.in_waiting).replace(self._sent, b"")  # echo of a broadcast
            if not is_copies(surplus, self._frame):
                self.surplus_count += 1
                self._must_clear = True
        if self._must_clear:  # late answers come and go: they look like those to the next request
            self.closing.wait(self.worst_latency_s)
            self.require_not_closed()
            if port is not None:
                port.reset_input_buffer()
            self._must_clear = False

    def _note(self, sending: bool, data: bytes) -> bytes:
        new = data if sending else data.removeprefix(self._received)  # all since the request comes
        self._record(TrafficDirection.SENT if sending else TrafficDirection.RECEIVED, new)
        if sending:
            self._sent = data
            return data
        self._received = data
        return data.removeprefix(self._sent).lstrip(NUL)

    @contextmanager
    def _requesting(self) -> Iterator[Any]:
        """The client, with nothing on the line that came before; its failures are those of the line."""
        self.require_not_closed()
        if self._client is None:
            raise lost_port(self.subject, self.url, "it is not open")
        try:
            self._drop_surplus()
            yield self._client
        except self._modbus.exceptions.ModbusIOException as error:
            self._must_clear = True
            raise NoAnswer(self._received, self._sent) from error
        except (OSError, termios.error, self._modbus.exceptions.ModbusException) as error:
            self.close()
            raise lost_port(self.subject, self.url, str(error)) from error
