"""Charts of a report as SVG text, which is the same each time; a mark says its value under the pointer."""

from dataclasses import dataclass
from math import ceil, floor, log10
from typing import Final

from hexacell.text.report.pages import Picture, rendered
from hexacell.text.svg_drawing import AFTER, BEFORE
from hexacell.verdict.decision import JudgedError

TOP, HEIGHT, LEFT, WIDTH = 30.0, 150.0, 58.0, 632.0
"""Place of the marks in a drawing that is 700 wide."""


@dataclass(frozen=True, slots=True)
class Mark:
    """A value with its expanded uncertainty, and the sentence that is shown under the pointer."""

    value: float
    sentence: str
    expanded: float = 0.0


@dataclass(frozen=True, slots=True)
class Series:
    """Marks side by side: before or after the calibration."""

    name: str
    marks: tuple[Mark, ...]
    is_before: bool = False

    @property
    def colour(self) -> str:
        """Apart from the other one for colour-blind readers too."""
        return BEFORE if self.is_before else AFTER


@dataclass(frozen=True, slots=True)
class Axis:
    """The vertical axis: its ends, and whether equal steps are equal ratios."""

    low: float
    high: float
    is_logarithmic: bool = False

    @property
    def ticks(self) -> list[float]:
        """Round values: every decade, or four to eight equal steps."""
        if self.is_logarithmic:
            return [10.0**decade for decade in range(ceil(log10(self.low)), floor(log10(self.high)) + 1)]
        rough = (self.high - self.low) / 4.0
        decade: float = 10.0 ** floor(log10(rough))
        step = max(size * decade for size in (1.0, 2.0, 5.0) if size * decade <= rough)
        return [step * number for number in range(ceil(self.low / step), floor(self.high / step) + 1)]

    def place(self, value: float) -> float:
        """Where a value is drawn, counted from the top."""
        low, high, at = self.low, self.high, min(max(value, self.low), self.high)
        if self.is_logarithmic:
            low, high, at = log10(low), log10(high), log10(at)
        return TOP + HEIGHT * (high - at) / (high - low)


def distances(series: tuple[Series, ...], title: str, caption: str) -> Picture:
    """Distances side by side, by decades; a reader of the HTML can look at one series alone."""
    values = [mark.value for one in series for mark in one.marks]
    smallest: Final = max(min(values), 1e-4)
    axis = Axis(10.0 ** floor(log10(smallest)), 10.0 ** ceil(log10(max(*values, 1.1 * smallest))), True)
    numbers = tuple(str(number + 1) for number in range(max(len(one.marks) for one in series)))
    return _picture(series, axis, numbers, title, caption)


def changes(series: Series, names: tuple[str, ...], title: str, caption: str) -> Picture:
    """Changes side by side, with their uncertainty, about a line at zero."""
    ends = [mark.value + side * mark.expanded for mark in series.marks for side in (-1.0, 1.0)]
    axis = Axis(1.05 * min(*ends, -1e-6), 1.05 * max(*ends, 1e-6))
    return _picture((series,), axis, names, title, caption)


def _picture(
    series: tuple[Series, ...], axis: Axis, names: tuple[str, ...], title: str, caption: str
) -> Picture:
    step = WIDTH / len(names)
    svg = rendered(
        "chart.svg.j2", series=series, axis=axis, names=names, title=title, step=step, left=LEFT + step / 2
    )
    return Picture(svg, caption, tuple(one.name for one in series) if len(series) > 1 else ())


def error_bar(error: JudgedError, unit: str) -> str:
    """An error with its uncertainty and guard band on the way to its limit."""
    band = error.guard_band_factor * (error.expanded or 0.0)
    shown = error.shown_in(unit)
    return rendered(
        "error_bar.svg.j2",
        error=error,
        shown=shown,
        scale=300.0 / (1.15 * max(error.limit, error.value + band)),
        band=band,
        sentence=error.sentence(unit),
    )
