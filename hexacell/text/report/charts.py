"""Charts of a report as SVG text, which is the same each time; a mark says its value under the pointer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10

from hexacell.text.report.pages import Picture, rendered
from hexacell.text.svg_drawing import SMALLEST_MM
from hexacell.verdict.decision import JudgedError


@dataclass(frozen=True, slots=True)
class Mark:
    """A value with its expanded uncertainty, and the sentence that is shown under the pointer."""

    value: float
    sentence: str
    expanded: float = 0.0


def chart(
    series: Mapping[str, Sequence[Mark]], names: Sequence[str], caption: str, *, by_decades: bool = False
) -> Picture:
    """Marks side by side, over their names; ``by_decades``: equal ratios are equally far apart."""

    def scaled(value: float) -> float:
        return log10(max(value, SMALLEST_MM)) if by_decades else value

    marks = [mark for one in series.values() for mark in one]
    ends = [scaled(mark.value + side * mark.expanded) for mark in marks for side in (-1.0, 1.0)]
    lowest, highest = min(ends), max(*ends, min(ends) + 1e-6)
    decade = 10.0 ** floor(log10(highest - lowest))
    step = 1.0 if by_decades else decade if highest - lowest > 3.0 * decade else decade / 2.0
    first, last = floor(lowest / step), ceil(highest / step)
    ticks = {at * step: 10.0 ** (at * step) if by_decades else at * step for at in range(first, last + 1)}
    svg = rendered("chart.svg.j2", series=series, names=names, ticks=ticks, scaled=scaled)
    return Picture(svg, caption, tuple(series) if len(series) > 1 else ())


def error_card(name: str, error: JudgedError, unit: str) -> Picture:
    """An error with U and guard band on the way to its limit, in figures and as a bar."""
    shown = error.shown_in(unit)
    end = error.value + error.guard_band_factor * (error.expanded or 0.0)
    scale = 284.0 / (1.1 * max(error.limit, end))
    svg = rendered("error_card.svg.j2", name=name, error=error, shown=shown, end=end, scale=scale)
    return Picture(svg, f"{name}: {error.sentence(unit)}: {error.verdict}")
