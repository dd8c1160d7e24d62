"""What the instruments read, raw, and the temperatures of the legs by it; nothing depends on a geometry."""

from collections.abc import Iterable, Sequence

import numpy as np

from hexacell.cell.devices import ThermometerSettings
from hexacell.cell.fields import Frozen, JointNumbers
from hexacell.measurements.records import (
    MEASURED_PARTS,
    Deviation,
    Temperatures,
    deviation_of,
    temperatures_of,
)
from procedures.run.keys import ArrivalDirections, ThreeNumbers


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
    variables, mm or deg, and ``directions`` those in which each had arrived. ``temperatures`` are those of
    the cell's thermometers just afterwards, ``part_temperatures`` of legs and base by them. ``at_s`` is the
    time of the run, s, when the window ended; it goes on while the run is interrupted. None in older ones.
    """

    gauges_mm: ThreeNumbers
    spread_mm: ThreeNumbers
    joints: JointNumbers
    temperatures: tuple[Temperature, ...] = ()
    directions: ArrivalDirections = ()
    part_temperatures: Temperatures = ()
    at_s: float | None = None

    def deviation_from(self, zero: "Reading") -> Deviation:
        """What the gauges show beside another reading, mm along base x, y, z."""
        return deviation_of(np.subtract(self.gauges_mm, zero.gauges_mm))


class ReadingSeries(RawReadings):
    """Readings taken one after the other while nothing moved.

    ``gauges_mm`` along base x, y, z and ``joints``, mm or deg, have an entry for each reading.
    """

    gauges_mm: tuple[ThreeNumbers, ...]
    joints: tuple[JointNumbers, ...]


def in_words(deviation_mm: Iterable[float]) -> str:
    """Three numbers along x, y and z, mm."""
    return ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", deviation_mm, strict=True))


def on_parts(thermometers: Iterable[ThermometerSettings], shown: Iterable[Temperature]) -> Temperatures:
    """The temperatures of legs and base by what thermometers showed; empty if none on one did."""
    celsius = {one.name: one.celsius for one in shown}
    placed = {place: celsius.get(one.name) for one in thermometers for place in (*one.legs, one.part)}
    found = tuple(placed.get(place) for place in (*range(1, MEASURED_PARTS), "base"))
    return found if any(one is not None for one in found) else ()


def mean_leg_temperatures(
    thermometers: Sequence[ThermometerSettings], readings: Iterable[Reading]
) -> tuple[float | None, ...]:
    """The mean temperature of each leg, deg C; None of a leg that has no thermometer, or a silent one."""
    shown = temperatures_of(on_parts(thermometers, reading.temperatures) for reading in readings)
    columns = (column[np.isfinite(column)] for column in shown.T[: MEASURED_PARTS - 1])
    return tuple(float(column.mean()) if len(column) else None for column in columns)


def temperatures_shown(readings: Iterable[Reading]) -> dict[str, list[float]]:
    """What each thermometer showed at some records, deg C, by name; without those that never answered."""
    shown: dict[str, list[float]] = {}
    for reading in readings:
        for one in reading.temperatures:
            if one.celsius is not None:
                shown.setdefault(one.name, []).append(one.celsius)
    return shown


def mean_temperature(readings: Iterable[Reading]) -> float | None:
    """The mean, deg C, of all that thermometers showed at some records; None if there was nothing."""
    shown = [celsius for every in temperatures_shown(readings).values() for celsius in every]
    return float(np.mean(shown)) if shown else None
