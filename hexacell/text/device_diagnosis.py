"""A device that was watched: figures, and what they mean."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from hexacell.services.devices.device_diagnosis import DeviceDiagnosis, Failure, SeriesFigures
from hexacell.text.planning import device_line

MEANING = {
    Failure.DAMAGED: "Answers are damaged: check its cable, its shield and its serial settings.",
    Failure.MISSING: "Answers are missing: check its cable and its supply.",
    Failure.AT_END: "Its plunger is at an end of its travel: move the gauge or the ball.",
    Failure.INVALID: "The device itself says that positions are invalid: look at its magnet or scale.",
}
NOISY = 3.0
"""A scatter of so many times what the cell file states is told."""


def diagnosis_document(found: DeviceDiagnosis) -> dict[str, Any]:
    """All figures."""
    return {**asdict(found), "is_usable": found.is_usable}


def diagnosis_lines(found: DeviceDiagnosis) -> Iterator[str]:
    """The figures in words, then what is wrong."""
    for identity in found.identities:
        yield device_line(identity)
    rate = found.readings / found.seconds if found.seconds else 0.0
    yield f"{_counted(found.readings, 'reading')} in {found.seconds:.1f} s, {rate:.1f} a second"
    for series in found.series:
        yield _series_line(series)
    if not found.failures:
        yield "No answer was damaged or missing."
    for failure in found.failures:
        was = "was" if failure.count == 1 else "were"
        yield f"{_counted(failure.count, 'answer')} {was} {failure.kind}, at last: {failure.latest}"
    yield from _meaning(found)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _series_line(series: SeriesFigures) -> str:
    scatter = "" if series.scatter is None else f", scatter {_micro(series.scatter, series.unit)}"
    span = f"{series.lowest:.4f} to {series.highest:.4f} {series.unit}"
    return f"{series.name}: {span}, {_counted(series.distinct, 'distinct value')}{scatter}"


def _meaning(found: DeviceDiagnosis) -> Iterator[str]:
    if found.problem:
        yield f"It cannot be used like this: {found.problem}"
    for failure in found.failures:
        yield MEANING[failure.kind]
    for series in found.series:
        if series.distinct == 1 and found.readings > 1:
            yield f"{series.name} showed one value only: move it by hand to see that it follows."
        elif series.scatter is not None and series.scatter > NOISY * found.stated_noise:
            stated = _micro(found.stated_noise, series.unit)
            yield f"{series.name} scatters more than the {stated} that [noise] states, or it moved."
    if found.is_usable and not found.failures:
        yield "It can be used."


def _micro(value: float, unit: str) -> str:
    return f"{1000.0 * value:.2g} um" if unit == "mm" else f"{value:.2g} {unit}"
