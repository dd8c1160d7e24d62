"""Encoders that are not CANopen devices: their messages and signals are those of a DBC file.

Each sends by itself, or all answer a request frame. A position counts if its frame came after the sample
was asked for, and a sample is complete if all six came within a window of time: nothing else makes them
simultaneous. cantools is imported when a cell names such a file.
"""

import logging
import threading
import time
from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import can

from drivers.encoders.bank import BankSession, ThreadedBank, bus_settings
from drivers.encoders.can_bus import EncoderBus
from drivers.encoders.canopen_node import THE_BUS
from drivers.errors import SilentNodeError, invalid_sample, optional, silent_encoder
from drivers.interfaces import DeviceIdentity
from drivers.wire_trace import TraceRecorder
from hexacell.cell.described_devices import DbcSettings
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import DeviceError, FileError, UsageError, did_you_mean
from hexacell.kinematics.parameters import JointUnit
from hexacell.storage.atomic_files import require_size

LENGTHS = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "um": 0.001, "\u00b5m": 0.001, "\u03bcm": 0.001, "nm": 1e-6}
ANGLES = {"deg": 1.0, "\u00b0": 1.0, "degree": 1.0, "rad": 57.29577951308232, "mrad": 0.05729577951308232}
SCALES = {JointUnit.MM: LENGTHS, JointUnit.DEG: ANGLES}
COARSER = 1.0 + 1e-6
"""By so much a count of the cell file may be larger than the signal's, for rounding."""
FARTHEST = 1e9
"""No joint is there, in its unit: what is farther, infinite or no number means no position."""

# Failures are raised as errors; without a handler cantools would also print its warnings.
logging.getLogger("cantools").addHandler(logging.NullHandler())


class FrameId(NamedTuple):
    """The identifier of a frame on the bus."""

    number: int
    is_extended: bool


@dataclass(frozen=True, slots=True)
class PositionSignal:
    """The position of one leg: a signal of a message; ``scale`` is one unit of it in that of the joint."""

    leg: int
    name: str
    frame: FrameId
    scale: float
    message: Any
    signal: Any

    @property
    def subject(self) -> str:
        """The subject of messages about this encoder."""
        return f"encoder of leg {self.leg} ({self.name})"


def read_signals(settings: DbcSettings, unit: JointUnit, step: float) -> tuple[PositionSignal, ...]:
    """The signals of legs 1 to 6; ``step`` is one count in the unit of the joint variables.

    Raises ``FileError`` if the file cannot be read, or lacks a message, signal, unit or range; a
    ``UsageError`` without cantools.
    """
    cantools = _cantools()
    require_size(Path(settings.file))
    try:
        with Path(settings.file).open("rb") as file:
            encoding = "utf-8-sig" if file.read(len(BOM_UTF8)) == BOM_UTF8 else None
        found = cantools.database.load_file(settings.file, encoding=encoding, strict=False)
    except (OSError, UnicodeDecodeError, cantools.Error) as error:
        raise FileError(f"cannot be read: {error}", subject=settings.file, action="Correct it") from error
    named = enumerate(settings.signals, 1)
    return tuple(_signal(found, settings, leg, name, unit, step) for leg, name in named)


def _cantools() -> Any:  # noqa: ANN401 - of a library that may be missing
    return optional("cantools", "dbc", "encoders")


def _signal(
    found: Any,  # noqa: ANN401 - of a library that may be missing
    settings: DbcSettings,
    leg: int,
    name: str,
    unit: JointUnit,
    step: float,
) -> PositionSignal:
    refused = partial(FileError, subject=settings.file)
    message_name, _, signal_name = name.partition(".")
    message = _named(found.messages, message_name, "message", settings)
    signal = _named(message.signals, signal_name, "signal", settings)
    try:
        message.refresh(strict=True)
    except _cantools().Error as error:
        raise refused(
            f"contradicts itself: {str(error).rstrip('.')}",
            action="Correct the signals there: the position would be read from bits of another",
        ) from error
    for needed in settings.must_be:
        _named(message.signals, needed, "signal", settings)
    scales = SCALES[unit]
    if signal.unit not in scales:
        problem = f"signal {name} is in {signal.unit or 'no unit'}, where joints are in {unit}"
        raise refused(problem, action=f"Give it one of the units {', '.join(scales)}")
    scale = scales[signal.unit]
    if not signal.is_float and step > COARSER * abs(signal.scale * scale):
        raise refused(
            f"signal {name} has finer steps ({abs(signal.scale * scale):g} {unit}) than a count ({step:g})",
            action="Correct measuring_step_nm or counts_per_turn in the cell file",
        )
    frame = FrameId(message.frame_id, bool(message.is_extended_frame))
    return PositionSignal(leg, name, frame, scale, message, signal)


def _named(all_of_them: Any, name: str, kind: str, settings: DbcSettings) -> Any:  # noqa: ANN401
    known = {one.name: one for one in all_of_them}
    if sum(one.name == name for one in all_of_them) > 1:
        raise FileError(f"has {kind} '{name}' twice", subject=settings.file, action="Remove one there")
    if name not in known:
        raise FileError(
            f"has no {kind} '{name}'",
            subject=settings.file,
            action=did_you_mean(name, tuple(known)) or f"It has {', '.join(sorted(known)[:12])}",
        )
    return known[name]


@dataclass(frozen=True, slots=True)
class _Received:
    """The latest position of a leg, in its unit; ``problem`` is why it cannot be trusted."""

    at_s: float
    position: float
    problem: str = ""


class DbcSession(BankSession):
    """A bus on which the encoders are heard."""

    def __init__(
        self, settings: EncoderSettings, closing: threading.Event, trace: TraceRecorder | None
    ) -> None:
        described = settings.dbc
        if described is None:
            problem = "the encoders' messages are not stated"
            raise UsageError(problem, action="Add [encoders.dbc] with file and signals to the cell file")
        self._described = described
        self._signals = read_signals(described, settings.unit, settings.step)
        self._frames = {signal.frame for signal in self._signals}
        super().__init__(settings, [signal.subject for signal in self._signals])
        self._latest: dict[int, _Received] = {}
        self._hears_others, self._incomplete = False, set[FrameId]()
        self.identities = tuple(
            DeviceIdentity(
                f"encoder of leg {one.leg}",  # such encoders have no names of their own
                "dbc",
                one.name,
                settings=f"steps of {one.signal.scale:g} {one.signal.unit}, offset {one.signal.offset:g}",
            )
            for one in self._signals
        )
        self._bus = EncoderBus(bus_settings(settings), closing, trace, self._accepts)
        self.close = self._bus.close

    def start(self) -> None:
        """Listen to all six, and take a first sample."""
        for frame in self._frames:
            self._bus.network.subscribe(frame.number, self._receiver(frame))
        self._sample()

    def _accepts(self, message: can.Message) -> bool:
        frame = FrameId(message.arbitration_id, message.is_extended_id)
        self._hears_others = self._hears_others or frame not in self._frames
        return message.is_rx and not message.is_remote_frame and frame in self._frames

    def _receiver(self, frame: FrameId) -> Callable[[int, bytearray, float], None]:
        signals = [signal for signal in self._signals if signal.frame == frame]

        def received(_can_id: int, data: bytearray, _timestamp: float) -> None:
            now = time.monotonic()
            for signal in signals:
                if (one := self._decoded(signal, bytes(data), now)) is not None:
                    self._latest[signal.leg] = one
            self._bus.condition.notify_all()

        return received

    def _decoded(self, signal: PositionSignal, data: bytes, now: float) -> _Received | None:
        """The position in a frame; None if the frame does not carry it, as a multiplexed one."""
        if len(data) != signal.message.length:
            problem = f"sends {len(data)} bytes, where the DBC file has {signal.message.length}"
            return _Received(now, 0.0, problem)
        try:
            values = signal.message.decode(data, decode_choices=False)
        except _cantools().Error as error:
            return _Received(now, 0.0, f"sends what the DBC file does not describe ({error})")
        if (value := values.get(signal.signal.name)) is None:
            self._incomplete.add(signal.frame)
            return None
        low, high, problem = signal.signal.minimum, signal.signal.maximum, ""
        position = float(value) * signal.scale
        if not abs(position) < FARTHEST:
            problem = f"sends {value:g}, which is no position"
        if (low is not None and value < low) or (high is not None and value > high):
            problem = f"sends {value:g}, outside the range in the DBC file"
        for name, expected in self._described.must_be.items():
            if values.get(name) != expected and not problem:
                problem = f"sends {name} {values.get(name)}, not {expected}"
        return _Received(now, position, problem)

    def _sample(self) -> tuple[int, ...]:
        """The counts of frames that came after now, within the window."""
        since_s = self._ask()
        complete = self._bus.wait_for(lambda: self._is_complete(since_s), self._settings.timeout_s)
        with self._bus.condition:
            latest = dict(self._latest)
        fresh = {leg: one for leg, one in latest.items() if one.at_s >= since_s}
        for signal in self._signals:
            if signal.leg in fresh and fresh[signal.leg].problem:
                action = "Remove the cause, or correct [encoders.dbc], then measure again"
                raise invalid_sample(fresh[signal.leg].problem, signal.subject, action)
        if silent := [signal for signal in self._signals if signal.leg not in fresh]:
            raise self._silence(silent)
        if not complete:
            times = [one.at_s for one in latest.values()]
            raise DeviceError(
                f"send {1000 * (max(times) - min(times)):.0f} ms apart, where a sample takes "
                f"{1000 * self._described.window_s:g} ms",
                subject="encoders",
                action="Let them send more often or on a request, or correct window_s in [encoders.dbc]",
            )
        return tuple(round(latest[signal.leg].position / self._settings.step) for signal in self._signals)

    def _silence(self, silent: list[PositionSignal]) -> SilentNodeError:
        what = f"sends nothing for {self._settings.timeout_s:g} s{self._bus.reported}"
        subject = ", ".join(one.subject for one in silent)
        if all(one.frame in self._incomplete for one in silent):
            what = "sends its message, but not with this signal"
            return silent_encoder(what, subject, "Correct signals in [encoders.dbc] (its multiplexer)")
        if len(silent) < len(self._signals):
            remedy = "Check its supply and cable, and the message in the DBC file"
            return silent_encoder(f"{what}; others do", subject, remedy)
        remedy = "Check the messages in the DBC file" if self._hears_others else f"{THE_BUS}, bit rate"
        remedy += ", and request in [encoders.dbc]" * (self._described.request is not None)
        return silent_encoder(what + ", but others do" * self._hears_others, "each encoder", remedy)

    def _ask(self) -> float:
        """Send the request, if there is one; the time from which on frames have later positions."""
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
            len(times) == len(self._signals)
            and min(times) >= since_s
            and max(times) - min(times) <= self._described.window_s
        )


class DbcBank(ThreadedBank[DbcSession]):
    """The encoder bank of a cell; implements :class:`drivers.interfaces.EncoderBank`."""

    session = DbcSession
