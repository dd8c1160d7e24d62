"""What the instruments read, raw: nothing here depends on a geometry."""

from __future__ import annotations

from collections.abc import Iterable

from hexacell.cell.fields import Frozen
from procedures.run.keys import SixNumbers, ThreeNumbers


class Temperature(Frozen):
    """The reading of a thermometer, deg C; without one, ``problem`` says why."""

    name: str
    celsius: float | None
    raw: str = ""
    problem: str = ""


class RawReadings(Frozen):
    """What the devices answered, in the order taken.

    ``answers`` are those of the gauges, ``counts`` those of the encoders; ``skews_s`` is the time from the
    first to the last answer of each of these.
    """

    answers: tuple[tuple[str, ...], ...]
    counts: tuple[tuple[int, ...], ...]
    skews_s: tuple[float, ...]


class Reading(RawReadings):
    """A settled window of readings.

    ``gauges_mm`` and ``spread_mm`` are mean and range along base x, y, z; ``joints`` are the mean joint
    variables, mm or deg. ``temperatures`` are those of the cell's thermometers just afterwards.
    """

    gauges_mm: ThreeNumbers
    spread_mm: ThreeNumbers
    joints: SixNumbers
    temperatures: tuple[Temperature, ...] = ()


class ReadingSeries(RawReadings):
    """Readings taken one after the other while nothing moved.

    ``gauges_mm`` along base x, y, z and ``joints``, mm or deg, have an entry for each reading.
    """

    gauges_mm: tuple[ThreeNumbers, ...]
    joints: tuple[SixNumbers, ...]


def in_words(deviation_mm: Iterable[float]) -> str:
    """Three numbers along x, y and z, mm."""
    return ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", deviation_mm, strict=True))
