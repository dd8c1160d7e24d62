"""A picture with axes, drawn by a library for plots in characters."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, floor, log10
from typing import TYPE_CHECKING

from textual.app import ComposeResult
from textual.containers import Vertical

from hexacell.screen.widgets import TextPanel

if TYPE_CHECKING:
    from textual_plot import AxisFormatter, PlotWidget

    from hexacell.text.screens.views import PlotView

COLOURS = ("primary", "warning", "success")
"""Of the series, in turn; markers tell them apart without colours."""

LEVEL_STEPS = 400
"""Characters of the line of a limit, more than any screen is wide: it is in the row of what equals it."""

AROUND = 0.04
"""Free room at the ends of each axis, as a share of it."""


def decades(low: float, high: float) -> list[float]:
    """The round values from one logarithm to another: 1, 2 and 5 of each decade; of many only 1."""
    steps = (1.0, 2.0, 5.0) if high - low < 3.0 else (1.0,)
    every = (step * 10.0**power for power in range(floor(low), ceil(high) + 1) for step in steps)
    return [log10(one) for one in every if low <= log10(one) <= high]


def whole_numbers(low: float, high: float, most: int) -> list[float]:
    """At most so many round whole numbers in a range, as records and runs are counted."""
    sizes = (step * 10**power for power in range(9) for step in (1, 2, 5))
    step = next(one for one in sizes if (high - low) / one <= most)
    return [float(one) for one in range(ceil(low / step) * step, floor(high) + 1, step)]


class PlotPanel(Vertical):
    """A view as large as there is room, in a frame with its title and what each marker is.

    The picture itself is made when there is something to draw.
    """

    def __init__(self, *, id: str | None = None, classes: str = "") -> None:  # noqa: A002 - as in every widget
        super().__init__(id=id, classes=f"panel {classes}")
        self._drawn: tuple[PlotView, str] | None = None
        self._across = (0.0, 1.0)
        self._plot: PlotWidget | None = None

    def on_resize(self) -> None:
        """Have as many values along the axis as there is room for."""
        if self._plot is not None:
            most = max(2, self.size.width // 9)
            self._plot.set_xticks(whole_numbers(*self._across, most=most))

    def compose(self) -> ComposeResult:
        """A note while there is nothing to draw."""
        yield TextPanel(classes="plot-note")

    def show(self, view: PlotView) -> None:
        """Show a view."""
        if (view, self.app.theme) == self._drawn:
            return
        note = self.query_one(".plot-note", TextPanel)
        if self._plot is None and not view.is_empty:
            from textual_plot import PlotWidget  # noqa: PLC0415 - needs numpy, after the first screen

            self._plot = PlotWidget(allow_pan_and_zoom=False, classes="plot")
            self.mount(self._plot)
        if self._plot is not None and not self._plot.is_mounted:
            # As it is mounted it forgets what it was given before.
            self.call_after_refresh(self.show, view)
            return
        self._drawn = (view, self.app.theme)
        self.border_title = view.title
        self.border_subtitle = "" if view.is_empty else f"{view.legend}   → {view.x_label}"
        note.show(view.note)
        note.display = view.is_empty
        if self._plot is not None:
            self._plot.display = not view.is_empty
            if not view.is_empty:
                self._draw(self._plot, view)

    def _draw(self, plot: PlotWidget, view: PlotView) -> None:
        plot.clear()
        up = log10 if view.is_logarithmic else float
        points = [[(x, up(y)) for x, y in one.points] for one in view.series]
        level = None if view.level is None else up(view.level)
        xs = _range([x for some in points for x, _ in some])
        ys = _range([y for some in points for _, y in some] + ([] if level is None else [level]))
        plot.set_xlimits(*xs)
        plot.set_ylimits(*ys)
        plot.margin_left, plot.margin_top, plot.margin_bottom = 7, 0, 1
        plot.set_y_formatter(_formatter(plot, is_logarithmic=view.is_logarithmic))
        self._across = xs
        self.on_resize()
        colours = self.app.theme_variables
        if level is not None:
            along = [xs[0] + (xs[1] - xs[0]) * step / LEVEL_STEPS for step in range(LEVEL_STEPS + 1)]
            plot.scatter(along, [level] * len(along), "┄", colours["error"])
        for number, (one, some) in enumerate(zip(view.series, points, strict=True)):
            if some:
                colour = colours[COLOURS[number % len(COLOURS)]]
                x, y = zip(*some, strict=True)
                plot.scatter(x, y, one.marker, f"bold {colour}")


def _range(values: Sequence[float]) -> tuple[float, float]:
    """From below the smallest to above the largest."""
    low, high = min(values), max(values)
    free = AROUND * (high - low) or 0.5
    return low - free, high + free


def _formatter(plot: PlotWidget, *, is_logarithmic: bool) -> AxisFormatter:
    from textual_plot import NumericAxisFormatter  # noqa: PLC0415 - see above

    if not is_logarithmic:
        return NumericAxisFormatter()

    class Logarithms(NumericAxisFormatter):
        """Round values on an axis of logarithms."""

        def get_ticks(self, min_: float, max_: float, max_ticks: int = 8) -> list[float]:
            found, most = decades(min_, max_), min(max_ticks, max(2, plot.size.height // 2))
            return found[:: 1 + len(found) // most]

        def get_labels_for_ticks(self, ticks: Sequence[float]) -> list[str]:
            return [f"{10.0**one:.3g}" for one in ticks]

    return Logarithms()
