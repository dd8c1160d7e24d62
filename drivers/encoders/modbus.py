"""Encoders with Modbus RTU: counts in registers, of one device with several inputs or of several devices.

Modbus has no SYNC. Registers of one device come in one answer, which is a sample. Several devices are
sampled at one instant if they can be told to keep their positions (``latch``, a broadcast). Where they
cannot, they are asked there and back, and the mean is the position at the instant in the middle: right
at rest and at a constant speed.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.encoders.bank import SampleHistory, ThreadedBank, joint_variables
from drivers.errors import BusError, InvalidSampleError, PortLost, SilentNodeError
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.serial.adapters import adapter_at
from drivers.serial.modbus_port import FUNCTIONS, REQUEST, ModbusPort, RefusedRequest
from drivers.serial.request_port import NoAnswer
from drivers.wire_trace import TraceRecorder
from hexacell.cell.described_devices import ModbusEncoderSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import UsageError

PROTOCOL = "modbus"
LINE = {"baudrate": 19200, "bytesize": 8, "parity": "E", "stopbits": 1}
DAMAGED_TRIES = 3


class ModbusBank(ThreadedBank["ModbusSession"]):
    """The encoder bank of a cell; see :class:`drivers.interfaces.EncoderBank`."""

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        super().__init__()
        if settings.modbus is None:
            raise UsageError(
                "it is not stated in which registers the encoders are",
                action="Add [encoders.modbus] with port and registers to the cell file",
            )
        self._settings, self._described = settings, settings.modbus
        self._trace = trace

    def _begin(self, closing: threading.Event) -> ModbusSession:
        return ModbusSession(self._settings, self._described, closing, self._trace)


class ModbusSession:
    """An open line on which all six encoders answered. Used by one thread."""

    def __init__(
        self,
        settings: EncoderSettings,
        described: ModbusEncoderSettings,
        closing: threading.Event,
        trace: TraceRecorder | None = None,
    ) -> None:
        self._settings, self._described, self._closing = settings, described, closing
        self._history = SampleHistory(settings, [f"encoder of leg {leg}" for leg in range(1, 7)])
        self._url = _port_of(described)
        self._port = ModbusPort(self._url, {**LINE, **described.serial}, closing, trace)
        self._port.subject = "encoders"
        try:
            self._spans = self._begin()
        except BaseException:
            self._port.close()
            raise

    @property
    def identities(self) -> tuple[DeviceIdentity, ...]:
        """Legs 1 to 6: such encoders have no names of their own."""
        adapter = adapter_at(self._url)
        return tuple(
            DeviceIdentity(
                f"encoder of leg {leg}", PROTOCOL, f"device {device}, register {register}", port=adapter
            )
            for leg, (device, register) in enumerate(self._described.places, 1)
        )

    def read(self) -> EncoderSample:
        """One complete sample.

        Raises:
            SilentNodeError: a device did not answer in time.
            InvalidSampleError: a count means no valid position, or a joint jumped.
            WrongSetting: negative counts are read as unsigned ones.
            DeviceError: a device refuses, or the line was lost.
        """
        counts = self._sampled(self._spans)
        self._history.check_signs(counts)
        positions = joint_variables(counts, self._settings)
        self._history.check_speed(positions)
        return EncoderSample(counts, positions, self._settings.unit)

    def close(self) -> None:
        """Close the line."""
        self._port.close()

    def _begin(self) -> tuple[RegisterSpan, ...]:
        """Open the line, and read; some devices refuse a request with registers that they do not have."""
        joined = register_spans(self._described, joined=True)
        single = register_spans(self._described, joined=False)
        try:
            self._port.open()
        except PortLost as error:
            raise BusError(error.problem, subject="encoders", action=error.action) from error
        try:
            self._sampled(joined)
        except RefusedRequest:
            self._sampled(single)
            return single
        return joined

    def _sampled(self, spans: Sequence[RegisterSpan]) -> tuple[int, ...]:
        """The counts of legs 1 to 6, at one instant."""
        try:
            return self._counts(spans)
        except PortLost as error:
            raise _lost(error) from error

    def _counts(self, spans: Sequence[RegisterSpan]) -> tuple[int, ...]:
        latch = self._described.latch
        if latch is not None:
            self._port.write_to_all(latch.register_, latch.value)
            self._closing.wait(latch.delay_s)
        there = self._read_all(spans)
        if latch is not None or len(spans) == 1:
            return there
        back = self._read_all(spans[::-1])
        return tuple(round((one + other) / 2) for one, other in zip(there, back, strict=True))

    def _read_all(self, spans: Sequence[RegisterSpan]) -> tuple[int, ...]:
        found = {leg: count for span in spans for leg, count in self._read_span(span).items()}
        return tuple(found[leg] for leg in sorted(found))

    def _read_span(self, span: RegisterSpan) -> dict[int, int]:
        """Counts by leg."""
        counts = counts_in(self._answer(span), span, self._described, signed=self._settings.signed)
        for leg, count in counts.items():
            if count in self._described.invalid:
                raise _invalid(leg, count)
        return counts

    def _answer(self, span: RegisterSpan) -> bytes:
        """The registers; a damaged answer is asked for again."""
        function = FUNCTIONS[self._described.kind]
        request = REQUEST.pack(span.device, function, span.first, span.count)
        self._port.subject = span.subject
        for _ in range(DAMAGED_TRIES):
            try:
                return self._port.exchange(request, b"", self._settings.timeout_s)
            except NoAnswer as error:
                received = error.received
                if not received:
                    break
        raise self._unanswered(span, received)

    def _unanswered(self, span: RegisterSpan, received: bytes) -> SilentNodeError:
        if received:
            return SilentNodeError(
                f"answers {received!r}, no single frame with a right checksum, {DAMAGED_TRIES} times",
                subject=span.subject,
                action="Check its cable, and serial in [encoders.modbus], then open the encoders again; "
                "the set that was being measured is void",
            )
        return SilentNodeError(
            f"does not answer within {self._settings.timeout_s:g} s",
            subject=span.subject,
            action="Check its supply and cable, and devices and serial in [encoders.modbus], then open the "
            "encoders again; the set that was being measured is void",
        )


def _invalid(leg: int, count: int) -> InvalidSampleError:
    return InvalidSampleError(
        f"shows {count}, which means no valid position; it cannot be trusted",
        subject=f"encoder of leg {leg}",
        action="Remove the cause, or correct invalid in [encoders.modbus], then measure again",
    )


def _port_of(described: ModbusEncoderSettings) -> str:
    if described.port is None:
        raise BusError(
            "have no port in the cell file",
            subject="encoders",
            action="State `port` under [encoders.modbus]",
        )
    return described.port


def _lost(error: PortLost) -> BusError:
    """The line is the encoders' bus: a run opens them again."""
    return BusError(
        error.problem,
        subject="encoders",
        action="Plug its adapter in and open the encoders again; the set that was being measured is void",
    )


MAX_REGISTERS = 125
"""Of an answer (Modbus Application Protocol 6.3)."""

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
        """Of messages."""
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
    size = described.bits // 8
    starts = {leg: REGISTER_BYTES * (described.registers[leg - 1] - span.first) for leg in span.legs}
    return {
        leg: _count(data[start : start + size], described, signed=signed) for leg, start in starts.items()
    }


def _count(data: bytes, described: ModbusEncoderSettings, *, signed: bool) -> int:
    registers = [data[start : start + REGISTER_BYTES] for start in range(0, len(data), REGISTER_BYTES)]
    if described.word_order == "little":
        registers.reverse()
    return int.from_bytes(b"".join(registers), signed=signed)
