"""Encoders with Modbus RTU: counts in registers, of one device with several inputs or of several devices.

Modbus has no SYNC. Registers of one device come in one answer, which is a sample. Several devices are
sampled at one instant if they can be made to keep their positions (``latch``, a broadcast). Where they
cannot, they are asked there and back, and the mean is the position at the instant in the middle: right
at rest and at a constant speed.
"""

import threading
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.encoders.bank import BankSession, ThreadedBank
from drivers.errors import BusError, PortLost, SilentNodeError, invalid_sample, silent_encoder
from drivers.interfaces import DeviceIdentity
from drivers.serial.modbus_port import FUNCTIONS, REQUEST, ModbusPort, RefusedRequest, wrong_frame
from drivers.serial.opening import adapter_at
from drivers.serial.request_port import NoAnswer
from drivers.wire_trace import TraceRecorder
from hexacell.cell.described_devices import ModbusEncoderSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import UsageError

LINE = {"baudrate": 19200, "bytesize": 8, "parity": "E", "stopbits": 1}
DAMAGED_TRIES = 3
ALL_SILENT = "Check the adapter, its supply and cable, and serial in [encoders.modbus]"
MAX_REGISTERS = 125
"""Registers that one answer can have (Modbus Application Protocol 6.3)."""
REGISTER_BITS, REGISTER_BYTES = 16, 2


@dataclass(frozen=True, slots=True)
class RegisterSpan:
    """Registers of one device that one request asks for, and the legs that are in them, from 1."""

    device: int
    first: int
    count: int
    legs: tuple[int, ...]

    @property
    def subject(self) -> str:
        """The subject of messages about these encoders."""
        legs = ", ".join(map(str, sorted(self.legs)))
        named = f"encoder of leg {legs}" if len(self.legs) == 1 else f"encoders of legs {legs}"
        return f"{named} (device {self.device})"


def register_spans(described: ModbusEncoderSettings, *, joined: bool) -> tuple[RegisterSpan, ...]:
    """The requests for all legs; ``joined``: one for the legs of a device, as far as an answer reaches."""
    words = described.bits // REGISTER_BITS
    spans: list[RegisterSpan] = []
    for (device, register), leg in sorted((place, leg) for leg, place in enumerate(described.places, 1)):
        last = spans[-1] if spans else None
        count = register + words - last.first if last else 0
        if joined and last and last.device == device and count <= MAX_REGISTERS:
            spans[-1] = RegisterSpan(device, last.first, count, (*last.legs, leg))
        else:
            spans.append(RegisterSpan(device, register, words, (leg,)))
    return tuple(spans)


def counts_in(
    data: bytes, span: RegisterSpan, described: ModbusEncoderSettings, *, signed: bool
) -> dict[int, int]:
    """The counts by leg in the registers of a span, each with its high byte first."""
    found = {}
    for leg in span.legs:
        start = REGISTER_BYTES * (described.registers[leg - 1] - span.first)
        own = data[start : start + described.bits // 8]
        if described.word_order == "little":
            own = own[REGISTER_BYTES:] + own[:REGISTER_BYTES]
        found[leg] = int.from_bytes(own, signed=signed)
    return found


class ModbusSession(BankSession):
    """A line on which the encoders answer."""

    def __init__(
        self, settings: EncoderSettings, closing: threading.Event, trace: TraceRecorder | None
    ) -> None:
        super().__init__(settings, [f"encoder of leg {leg}" for leg in range(1, 7)])
        described = settings.modbus
        if described is None:
            raise UsageError(
                "it is not stated in which registers the encoders are",
                action="Add [encoders.modbus] with port and registers to the cell file",
            )
        self._described, self._closing = described, closing
        if described.port is None:
            problem = "have no port in the cell file"
            raise BusError(problem, subject="encoders", action="State `port` under [encoders.modbus]")
        self._url = described.port
        line = {**LINE, **described.serial, "settle_s": described.settle_s}
        self._port = ModbusPort(self._url, line, closing, trace)
        self._port.subject = "encoders"
        self.close = self._port.close
        self._answering, self._has_sampled = set[int](), False

    def start(self) -> None:
        """Open the line, and read; some devices refuse a request with registers that they do not have."""
        try:
            self._port.open()
        except PortLost as error:
            raise BusError(error.problem, subject="encoders", action=error.action) from error
        self._spans = register_spans(self._described, joined=True)
        try:
            self._sample()
        except RefusedRequest as refused:
            if not refused.is_absence:
                raise
            self._spans = register_spans(self._described, joined=False)
            self._sample()
        self._has_sampled = True
        adapter = adapter_at(self._url)
        self.identities = tuple(  # such encoders have no names of their own
            DeviceIdentity(subject, "modbus", f"device {device}, register {register}", port=adapter)
            for subject, (device, register) in zip(self.subjects, self._described.places, strict=True)
        )

    def _sample(self) -> tuple[int, ...]:
        latch, spans = self._described.latch, self._spans
        try:
            if latch is not None:
                self._port.write_to_all(latch.register_, latch.value)
                self._closing.wait(latch.delay_s)
            there = self._read_all(spans)
            if latch is not None or len(spans) == 1:
                return there
            back = self._read_all(spans[::-1])
        except PortLost as error:  # the line is the encoders' bus: a run opens them again
            raise BusError(error.problem, subject="encoders", action=error.action) from error
        return tuple(round((one + other) / 2) for one, other in zip(there, back, strict=True))

    def _read_all(self, spans: Sequence[RegisterSpan]) -> tuple[int, ...]:
        found: dict[int, int] = {}
        silent: list[SilentNodeError] = []
        for span in spans:
            try:
                answer = self._answer(span)
            except SilentNodeError as error:
                silent.append(error)
                continue
            found |= counts_in(answer, span, self._described, signed=self._settings.signed)
            for leg in span.legs:
                if found[leg] in self._described.invalid:
                    raise invalid_sample(
                        f"shows {found[leg]}, which means no valid position",
                        f"encoder of leg {leg}",
                        "Remove the cause, or correct invalid in [encoders.modbus], then measure again",
                    )
        if len(silent) > 1 and not found:
            raise silent_encoder(silent[0].problem, "each of the encoders", ALL_SILENT)
        if silent:
            raise silent[0]
        return tuple(found[leg] for leg in sorted(found))

    def _answer(self, span: RegisterSpan) -> bytes:
        """The registers; a damaged answer is asked for again."""
        request = REQUEST.pack(span.device, FUNCTIONS[self._described.kind], span.first, span.count)
        self._port.subject = span.subject
        for _ in range(DAMAGED_TRIES):
            try:
                answer = self._port.exchange(request, b"", self._settings.timeout_s)
            except NoAnswer as error:
                missing = error
                if not missing.received:
                    break
            else:
                self._answering.add(span.device)
                return answer
        what = f"does not answer within {self._settings.timeout_s:g} s"
        remedy = "Check its supply and cable, and "
        remedy += "timeout_s" if self._has_sampled else "devices and serial in [encoders.modbus]"
        if self._answering - {span.device}:
            what += f", while device {min(self._answering - {span.device})} on the same line does"
            remedy = "Check its own supply, and devices in [encoders.modbus]"
        if missing.received:
            came, remedy = wrong_frame(missing.beside_echo, span.device)
            what = f"answers {came}, {DAMAGED_TRIES} times"
        self._answering.discard(span.device)
        raise silent_encoder(what, span.subject, remedy)


class ModbusBank(ThreadedBank[ModbusSession]):
    """The encoder bank of a cell; implements :class:`drivers.interfaces.EncoderBank`."""

    session = ModbusSession
