"""Pictures with axes in characters: markers instead of colours, so that any terminal shows them."""

from dataclasses import dataclass
from math import ceil, floor, isfinite, log10

from hexacell.text.screens.views import PlotView

LABEL_COLUMNS = 6
"""Left of the vertical axis."""
FEWEST_COLUMNS, FEWEST_ROWS = 16, 5
"""In less room a picture says nothing."""

LEVEL = "-"


@dataclass(frozen=True, slots=True)
class _Scale:
    """Values from ``low`` to ``high`` on a number of cells; logarithms if ``is_logarithmic``."""

    low: float
    high: float
    cells: int
    is_logarithmic: bool = False

    def cell(self, value: float) -> int:
        """The cell of a value, from 0."""
        low, high, place = (
            log10(one) if self.is_logarithmic else one for one in (self.low, self.high, value)
        )
        share = (place - low) / (high - low)
        return round(min(max(share, 0.0), 1.0) * (self.cells - 1))


def plot_lines(view: PlotView, columns: int, rows: int) -> list[str]:
    """A picture of ``rows`` lines and ``columns`` columns; empty where there is no room or no point."""
    if view.is_empty or columns < FEWEST_COLUMNS or rows < FEWEST_ROWS:
        return []
    xs = [x for series in view.series for x in series.xs]
    across = _Scale(min(xs), max(xs) if max(xs) > min(xs) else min(xs) + 1.0, columns - LABEL_COLUMNS - 1)
    down = _down(view, rows - 2)
    cells = [[" "] * across.cells for _ in range(down.cells)]
    if view.level is not None:
        cells[down.cell(view.level)] = [LEVEL] * across.cells
    for series in view.series:
        for x, y in zip(series.xs, series.ys, strict=True):
            cells[down.cell(y)][across.cell(x)] = series.marker
    labels = _labels(down)
    drawn = [f"{labels.get(row, ''):>{LABEL_COLUMNS}}|{''.join(cells[row])}" for row in range(down.cells)]
    drawn.reverse()
    first, last = f"{across.low:g}", f"{across.high:g}"
    middle = view.x_label.center(max(0, across.cells - len(first) - len(last)))
    below = f"{'':{LABEL_COLUMNS + 1}}{first}{middle}{last}"[: LABEL_COLUMNS + 1 + across.cells]
    return [*drawn, f"{'':{LABEL_COLUMNS}}+{'-' * across.cells}", below]


def _down(view: PlotView, cells: int) -> _Scale:
    """From one round number to another, so that both ends have a label."""
    ys = [y for series in view.series for y in series.ys if isfinite(y)]
    ys += [] if view.level is None else [view.level]
    low, high = min(ys), max(ys)
    if view.is_logarithmic:
        power = 10.0 ** floor(log10(low))
        first = max(part * power for part in (1.0, 2.0, 5.0) if part * power <= low * (1.0 + 1e-9))
        last = _round_above(high)
        return _Scale(first, last if last > first else 10.0 * first, cells, is_logarithmic=True)
    step = _step(high - low, cells)
    first, last = step * floor(low / step), step * ceil(high / step)
    return _Scale(first, last if last > first else first + step, cells)


def _round_above(value: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is not below a value."""
    power = 10.0 ** floor(log10(value))
    return min(part * power for part in (1.0, 2.0, 5.0, 10.0) if part * power >= value * (1.0 - 1e-9))


def _step(span: float, cells: int) -> float:
    """Between labels; at most one for every two cells."""
    return _round_above(max(span, 1e-6) / max(1, cells // 3))


def _labels(scale: _Scale) -> dict[int, str]:
    """Numbers beside some of the cells."""
    if not scale.is_logarithmic:
        step = _step(scale.high - scale.low, scale.cells)
        count = round((scale.high - scale.low) / step)
        return {scale.cell(scale.low + n * step): f"{scale.low + n * step:g}" for n in range(count + 1)}
    powers = range(floor(log10(scale.low)), ceil(log10(scale.high)) + 1)
    few = len(powers) * 3 <= scale.cells
    values = [part * 10.0**power for power in powers for part in ((1.0, 2.0, 5.0) if few else (1.0,))]
    ends = (scale.low, scale.high)
    inside = [value for value in values if scale.low <= value <= scale.high]
    return {scale.cell(value): f"{value:.3g}" for value in (*inside, *ends)}
