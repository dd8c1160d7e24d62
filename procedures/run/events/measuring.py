"""Events of measuring: where the robot is, what instruments read, and what becomes of records and sets.

Readings are raw and depend on no geometry: encoder counts, gauge answers, and the commanded pose.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AliasChoices, Field

from hexacell.cell.fields import Frozen
from hexacell.noise.measured_noise import MeasuredNoise
from procedures.run.steps import SetKey, SixNumbers, ThreeNumbers

Joints = Annotated[SixNumbers, Field(validation_alias=AliasChoices("joints", "joints_mm"))]
"""The six joint variables, mm or deg; up to version 11 a journal had another name for them."""


class Arrived(Frozen):
    """A move has ended at its pose."""

    kind: Literal["arrived"] = "arrived"
    at: SetKey
    orientation: int
    pose: SixNumbers


class PoseExcluded(Frozen):
    """The controller refused a pose and did not move; it is not commanded again in this run.

    ``axis`` is the axis beyond whose limit it is, the highest or the lowest; then no pose is commanded that
    is as far out. Without it the pose alone is left out. ``replacements`` are held-out poses that cannot be
    commanded now, each with the one that takes its place.
    """

    kind: Literal["excluded"] = "excluded"
    at: SetKey
    orientation: int
    pose: SixNumbers
    reason: str
    axis: Literal["x", "y", "z", "a", "b", "c"] | None = None
    is_highest: bool = True
    replacements: tuple[tuple[SixNumbers, SixNumbers], ...] = ()


class Located(Frozen):
    """Controller and encoders agree on where the robot is, after that had been unknown.

    Up to version 8 only the ``pose`` was read.
    """

    kind: Literal["located"] = "located"
    pose: SixNumbers
    joints: SixNumbers | None = Field(None, validation_alias=AliasChoices("joints", "joints_mm"))
    encoders: SixNumbers | None = Field(None, validation_alias=AliasChoices("encoders", "encoders_mm"))


class GaugesPlaced(Frozen):
    """The gauges are placed around the ball."""

    kind: Literal["placed"] = "placed"
    at: SetKey


class Temperature(Frozen):
    """The reading of a thermometer, deg C; without one, ``problem`` says why."""

    name: str
    celsius: float | None
    raw: str = ""
    problem: str = ""


class Reading(Frozen):
    """A settled window of readings.

    ``gauges_mm`` and ``spread_mm`` are mean and range along base x, y, z; ``joints`` the mean
    joint variables. ``answers`` and ``counts`` are the raw readings behind them, in the order taken;
    ``skews_s`` is the time from the first to the last answer of each of these, empty up to version 13.
    ``temperatures`` are those of the cell's thermometers just afterwards.
    """

    gauges_mm: ThreeNumbers
    spread_mm: ThreeNumbers
    joints: Joints
    answers: tuple[tuple[str, ...], ...]
    counts: tuple[tuple[int, ...], ...]
    skews_s: tuple[float, ...] = ()
    temperatures: tuple[Temperature, ...] = ()


class RecordTaken(Frozen):
    """A record was taken; ``deviation_mm`` is from the set's reference."""

    kind: Literal["sampled"] = "sampled"
    at: SetKey
    orientation: int
    pose: SixNumbers
    reading: Reading
    deviation_mm: ThreeNumbers


class RecordRejected(Frozen):
    """A record was rejected: the ball left the travel. Its orientation is chosen again.

    There is no ``reading`` if a plunger was at its end.
    """

    kind: Literal["refused"] = "refused"
    at: SetKey
    orientation: int
    reason: str
    reading: Reading | None = None


class RecordDiscarded(Frozen):
    """A record no longer counts and is taken again at the same pose. It stays in the journal."""

    kind: Literal["undone"] = "undone"
    at: SetKey
    orientation: int


class ReferenceConfirmed(Frozen):
    """The reference was read again after an interruption: ``change_mm`` is small, the set continues."""

    kind: Literal["confirmed"] = "confirmed"
    at: SetKey
    change_mm: ThreeNumbers
    reading: Reading | None = None


class StandstillRead(Frozen):
    """The devices were read again and again at a reference while nothing moved.

    ``gauges_mm`` along base x, y, z and ``joints`` have an entry for each reading, ``answers`` and
    ``counts`` are the raw readings behind them.
    """

    kind: Literal["stood"] = "stood"
    at: SetKey
    gauges_mm: tuple[ThreeNumbers, ...]
    joints: tuple[SixNumbers, ...] = Field(validation_alias=AliasChoices("joints", "joints_mm"))
    answers: tuple[tuple[str, ...], ...]
    counts: tuple[tuple[int, ...], ...]
    skews_s: tuple[float, ...] = ()


class PilotTaken(Frozen):
    """The reference was left for a pilot pose, and the gauges were read there."""

    kind: Literal["piloted"] = "piloted"
    at: SetKey
    orientation: int
    pose: SixNumbers
    reading: Reading


class ReferenceRepeated(Frozen):
    """The reference was left, visited again from another direction, and read."""

    kind: Literal["repeated"] = "repeated"
    at: SetKey
    reading: Reading


class GaugesProbed(Frozen):
    """The ball was moved by a small known distance from a set's reference, and the gauges were read."""

    kind: Literal["probed"] = "probed"
    at: SetKey
    moved_mm: ThreeNumbers
    reading: Reading


class GaugesTried(Frozen):
    """The gauges of a set follow the ball, each on its axis, with its sign and scale.

    ``response`` is what the gauges x, y, z showed per length of a move along x, y, z.
    """

    kind: Literal["tried"] = "tried"
    at: SetKey
    response: tuple[ThreeNumbers, ThreeNumbers, ThreeNumbers]


class NoiseMeasured(Frozen):
    """The noise of gauges and encoders that the run counts with from now on.

    If records are the mean of several windows from now on, the set's reference is recorded again.
    """

    kind: Literal["noise measured"] = "noise measured"
    at: SetKey
    noise: MeasuredNoise


class SetClosed(Frozen):
    """The reference was read again; ``drift_mm`` is the change since it was zeroed.

    The ``reason`` is why the set has fewer records than planned; empty where it has all.
    """

    kind: Literal["closed"] = "closed"
    at: SetKey
    drift_mm: ThreeNumbers
    reading: Reading | None = None
    reason: str = ""


class SetInvalidated(Frozen):
    """The set does not count and is measured again. Its records stay in the journal.

    There is a ``reading`` if its reference was read again and had changed.
    """

    kind: Literal["voided"] = "voided"
    at: SetKey
    reason: str
    reading: Reading | None = None
