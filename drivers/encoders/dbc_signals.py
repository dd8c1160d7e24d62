"""Signals of a DBC file as positions of joints; cantools is imported when a cell names such a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drivers.extras import optional
from hexacell.cell.described_devices import DbcSettings
from hexacell.errors import FileError, did_you_mean
from hexacell.kinematics.parameters import JointUnit

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
