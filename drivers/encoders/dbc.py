"""Encoders that are no CANopen devices: their messages and signals are those of a DBC file.

Each sends by itself, or all answer a request frame. A position counts if its frame came after the sample
was asked for, and a sample is complete if all six came within a window of time: nothing else makes them
simultaneous.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import can

from drivers.encoders.bank import SampleHistory, ThreadedBank, bus_settings, joint_variables
from drivers.encoders.can_bus import EncoderBus
from drivers.errors import InvalidSampleError, SilentNodeError
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.libraries import optional
from drivers.wire_trace import TraceRecorder
from hexacell.cell.described_devices import DbcSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import DeviceError, FileError, UsageError, did_you_mean
from hexacell.kinematics.parameters import JointUnit

PROTOCOL = "dbc"


class DbcBank(ThreadedBank["DbcSession"]):
    """The encoder bank of a cell; see :class:`drivers.interfaces.EncoderBank`."""

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        super().__init__()
        if settings.dbc is None:
            raise UsageError(
                "the encoders' messages are not stated",
                action="Add [encoders.dbc] with file and signals to the cell file",
            )
        self._settings, self._described = settings, settings.dbc
        self._trace = trace

    def _begin(self, closing: threading.Event) -> DbcSession:
        return DbcSession(self._settings, self._described, closing, self._trace)


@dataclass(frozen=True, slots=True)
class _Received:
    """The latest position of a leg, in its unit; ``problem`` is why it cannot be trusted."""

    at_s: float
    position: float
    problem: str = ""


class DbcSession:
    """An open bus on which all six encoders were heard."""

    def __init__(
        self,
        settings: EncoderSettings,
        described: DbcSettings,
        closing: threading.Event,
        trace: TraceRecorder | None = None,
    ) -> None:
        self._settings, self._described = settings, described
        self._database: Database = read_database(described, settings.unit, settings.step)
        self._latest: dict[int, _Received] = {}
        self._history = SampleHistory(settings, [_subject(signal) for signal in self._database.signals])
        self._bus = EncoderBus(bus_settings(settings), closing, trace, self._accepts)
        try:
            for frame in self._database.frames:
                self._bus.network.subscribe(frame.number, self._receiver(frame))
            self._fresh_positions()
        except BaseException:
            self._bus.close()
            raise

    @property
    def identities(self) -> tuple[DeviceIdentity, ...]:
        """Legs 1 to 6; such encoders have no names of their own."""
        return tuple(
            DeviceIdentity(f"encoder of leg {signal.leg}", PROTOCOL, signal.name, settings=_setting(signal))
            for signal in self._database.signals
        )

    def read(self) -> EncoderSample:
        """One complete sample.

        Raises:
            SilentNodeError: an encoder sent nothing in time.
            InvalidSampleError: a position is outside the range of its signal, has an error, or jumped.
            DeviceError: the six did not come within the window, or the bus failed.
        """
        settings = self._settings
        found = self._fresh_positions()
        counts = tuple(round(position / settings.step) for position in found)
        positions = joint_variables(counts, settings)
        self._history.check_speed(positions)
        return EncoderSample(counts, positions, settings.unit)

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

    def _accepts(self, message: can.Message) -> bool:
        frame = FrameId(message.arbitration_id, message.is_extended_id)
        return message.is_rx and not message.is_remote_frame and frame in self._database.frames

    def _receiver(self, frame: FrameId) -> Callable[[int, bytearray, float], None]:
        signals = [signal for signal in self._database.signals if signal.frame == frame]

        def received(_can_id: int, data: bytearray, _timestamp: float) -> None:
            now = time.monotonic()
            for signal in signals:
                if (one := self._decoded(signal, bytes(data), now)) is not None:
                    self._latest[signal.leg] = one
            self._bus.condition.notify_all()

        return received

    def _decoded(self, signal: PositionSignal, data: bytes, now: float) -> _Received | None:
        """The position in a frame; none if the frame does not carry it."""
        if len(data) != signal.message.length:
            problem = f"sends {len(data)} bytes, where the DBC file has {signal.message.length}"
            return _Received(now, 0.0, problem)
        try:
            values = signal.message.decode(data, decode_choices=False)
        except self._database.errors as error:
            return _Received(now, 0.0, f"sends what the DBC file does not describe ({error})")
        position = signal.position(values)
        if position is None:
            return None
        return _Received(now, position, self._problem(signal, values))

    def _problem(self, signal: PositionSignal, values: dict[str, float]) -> str:
        if not signal.is_in_range(values):
            return f"sends {values[signal.signal.name]:g}, outside the range in the DBC file"
        for name, expected in self._described.must_be.items():
            if values.get(name) != expected:
                return f"sends {name} {values.get(name)}, not {expected}"
        return ""

    def _fresh_positions(self) -> tuple[float, ...]:
        """The positions of legs 1 to 6 that came after now, within the window."""
        since_s = self._ask()
        complete = self._bus.wait_for(lambda: self._is_complete(since_s), self._settings.timeout_s)
        with self._bus.condition:
            latest = dict(self._latest)
        fresh = {leg: one for leg, one in latest.items() if one.at_s >= since_s}
        for signal in self._database.signals:
            if signal.leg in fresh and fresh[signal.leg].problem:
                raise self._untrusted(signal, fresh[signal.leg].problem)
        for signal in self._database.signals:
            if signal.leg not in fresh:
                raise self._silent(signal)
        if not complete:
            raise self._scattered(latest)
        return tuple(latest[signal.leg].position for signal in self._database.signals)

    def _ask(self) -> float:
        """Send the request, if there is one; the time from which on frames have positions of after now."""
        now = time.monotonic()
        if self._described.request is None:
            return now + self._described.delay_s
        number, _, data = self._described.request.partition("#")
        self._bus.network.send_message(int(number, 16), bytes.fromhex(data))
        return now

    def _is_complete(self, since_s: float) -> bool:
        """Whether all six came, within the window; or one that is a fault."""
        if any(one.problem for one in self._latest.values() if one.at_s >= since_s):
            return True
        times = [one.at_s for one in self._latest.values()]
        return (
            len(times) == len(self._database.signals)
            and min(times) >= since_s
            and max(times) - min(times) <= self._described.window_s
        )

    def _untrusted(self, signal: PositionSignal, problem: str) -> InvalidSampleError:
        return InvalidSampleError(
            f"{problem}; its position cannot be trusted",
            subject=_subject(signal),
            action="Remove the cause, or correct [encoders.dbc], then measure again",
        )

    def _silent(self, signal: PositionSignal) -> SilentNodeError:
        return SilentNodeError(
            f"sends nothing for {self._settings.timeout_s:g} s",
            subject=_subject(signal),
            action="Check its supply and cable, and the message in the DBC file, then open the encoders "
            "again; the set that was being measured is void",
        )

    def _scattered(self, latest: dict[int, _Received]) -> DeviceError:
        times = [one.at_s for one in latest.values()]
        return DeviceError(
            f"send {1000 * (max(times) - min(times)):.0f} ms apart, where a sample takes "
            f"{1000 * self._described.window_s:g} ms",
            subject="encoders",
            action="Let them send more often or on a request, or correct window_s in [encoders.dbc]",
        )


def _setting(signal: PositionSignal) -> str:
    return f"steps of {signal.signal.scale:g} {signal.signal.unit}, offset {signal.signal.offset:g}"


def _subject(signal: PositionSignal) -> str:
    return f"encoder of leg {signal.leg} ({signal.name})"


EXTRA = "dbc"
LENGTHS = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "um": 0.001, "\u00b5m": 0.001, "\u03bcm": 0.001, "nm": 1e-6}
ANGLES = {"deg": 1.0, "\u00b0": 1.0, "degree": 1.0, "rad": 57.29577951308232, "mrad": 0.05729577951308232}
SCALES = {JointUnit.MM: LENGTHS, JointUnit.DEG: ANGLES}
COARSER = 1.0 + 1e-6
"""By so much a count of the cell file may be larger than the signal's, for rounding."""


@dataclass(frozen=True, slots=True)
class FrameId:
    """The identifier of a frame on the bus."""

    number: int
    is_extended: bool


@dataclass(frozen=True, slots=True)
class PositionSignal:
    """The position of one leg: a signal of a message, and what a unit of it is in that of the joint."""

    leg: int
    name: str
    frame: FrameId
    scale: float
    message: Any
    signal: Any

    def position(self, values: Mapping[str, Any]) -> float | None:
        """The position in decoded values; none if the frame does not carry it, as a multiplexed one."""
        value = values.get(self.signal.name)
        return None if value is None else float(value) * self.scale

    def is_in_range(self, values: Mapping[str, Any]) -> bool:
        """Whether the value is within the range that the DBC file states, if it states one."""
        value, low, high = values[self.signal.name], self.signal.minimum, self.signal.maximum
        return (low is None or value >= low) and (high is None or value <= high)


@dataclass(frozen=True, slots=True)
class Database:
    """What a cell file wants of its DBC file."""

    signals: tuple[PositionSignal, ...]
    errors: type[Exception]
    """Of frames that cannot be decoded."""

    @property
    def frames(self) -> frozenset[FrameId]:
        """Those that carry positions."""
        return frozenset(signal.frame for signal in self.signals)


def read_database(settings: DbcSettings, unit: JointUnit, step: float) -> Database:
    """The signals of legs 1 to 6; ``step`` is one count in the unit of the joint variables.

    Raises:
        UsageError: cantools is not installed.
        FileError: the file cannot be read, or lacks a message, a signal, a unit or a range.
    """
    cantools = optional("cantools", EXTRA, "encoders")
    try:
        found = cantools.database.load_file(settings.file)
    except (OSError, UnicodeDecodeError, cantools.Error) as error:
        raise FileError(f"cannot be read: {error}", subject=settings.file, action="Correct it") from error
    signals = tuple(
        _signal(found, settings, leg, name, unit, step) for leg, name in enumerate(settings.signals, 1)
    )
    return Database(signals, cantools.Error)


def _signal(
    found: Any,  # noqa: ANN401 - of a library that may be missing
    settings: DbcSettings,
    leg: int,
    name: str,
    unit: JointUnit,
    step: float,
) -> PositionSignal:
    message_name, _, signal_name = name.partition(".")
    messages = {message.name: message for message in found.messages}
    message = _named(messages, message_name, "message", settings)
    signal = _named({one.name: one for one in message.signals}, signal_name, "signal", settings)
    for needed in settings.must_be:
        _named({one.name: one for one in message.signals}, needed, "signal", settings)
    scales = SCALES[unit]
    if signal.unit not in scales:
        raise FileError(
            f"signal {name} is in {signal.unit or 'no unit'}, where joints are in {unit}",
            subject=settings.file,
            action=f"Give it one of the units {', '.join(scales)}",
        )
    scale = scales[signal.unit]
    if not signal.is_float and step > COARSER * abs(signal.scale * scale):
        raise FileError(
            f"signal {name} has finer steps ({abs(signal.scale * scale):g} {unit}) than a count ({step:g})",
            subject=settings.file,
            action="Correct measuring_step_nm or counts_per_turn in the cell file",
        )
    frame = FrameId(message.frame_id, bool(message.is_extended_frame))
    return PositionSignal(leg, name, frame, scale, message, signal)


def _named(known: Mapping[str, Any], name: str, kind: str, settings: DbcSettings) -> Any:  # noqa: ANN401
    if name not in known:
        raise FileError(
            f"has no {kind} '{name}'",
            subject=settings.file,
            action=did_you_mean(name, tuple(known)) or f"It has {', '.join(sorted(known)[:12])}",
        )
    return known[name]
