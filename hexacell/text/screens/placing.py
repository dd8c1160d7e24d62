"""Gauges that are being placed: ball, plungers and axes as mounted, and how far each is from its place."""

from collections.abc import Sequence
from dataclasses import dataclass

from hexacell.run_process.live_snapshot import GaugeSnapshot, LiveSnapshot
from hexacell.text.screens.devices import WIDE_BAR, plunger_place, travel_bar
from hexacell.text.screens.views import Line, Urgency

BALL = ((-1, -3, "▄████▄"), (0, -3, "██████"), (1, -3, "▀████▀"))
"""Row, column and text of what shows the ball, about its middle."""

MIDDLE = (5, 20)
AXES = ((7, 1, "z"), (8, 1, "│ y"), (9, 1, "│/"), (10, 1, "└── x"))
COLUMNS, ROWS = 35, 11


@dataclass(frozen=True, slots=True)
class Placing:
    """The gauges around the ball while somebody places them.

    Attributes:
        picture: rows of pieces of text that make the picture, each with its urgency.
        gauges: for each gauge what to do, and below it its plunger in its travel.
        are_in_place: whether all of them are.
    """

    picture: tuple[tuple[Line, ...], ...]
    gauges: tuple[tuple[Line, Line], ...]
    are_in_place: bool


def placing(live: LiveSnapshot | None, mounting_mm: float) -> Placing:
    """How the gauges stand; ``mounting_mm`` is how far from mid travel a plunger may be."""
    gauges = () if live is None else live.gauges
    urgencies: dict[str, Urgency] = {one.axis: _urgency(one, mounting_mm) for one in gauges}
    rows = [_rows_of(one, mounting_mm, urgencies[one.axis]) for one in gauges]
    is_done = bool(gauges) and all(one is Urgency.GOOD for one in urgencies.values())
    return Placing(_picture(gauges, urgencies), tuple(rows), is_done)


def _urgency(gauge: GaugeSnapshot, mounting_mm: float) -> Urgency:
    if gauge.problem or gauge.shown_mm is None:
        return Urgency.ALARM
    place = plunger_place(gauge)
    return Urgency.GOOD if place is None or abs(place) <= mounting_mm else Urgency.ATTENTION


def _rows_of(gauge: GaugeSnapshot, mounting_mm: float, urgency: Urgency) -> tuple[Line, Line]:
    bar = travel_bar(plunger_place(gauge), gauge.travel_mm / 2.0, WIDE_BAR, mounting_mm)
    mark = "✓" if urgency is Urgency.GOOD else "✗" if urgency is Urgency.ALARM else "→"
    name = gauge.name if gauge.name == gauge.axis else f"{gauge.name} ({gauge.axis})"
    advice = f"{mark} {name}  {mounting_advice(gauge, mounting_mm)}"
    return (advice, urgency), (f"  {bar}", urgency)


def mounting_advice(gauge: GaugeSnapshot, mounting_mm: float) -> str:
    """What to do with a gauge that is being placed."""
    if gauge.problem:
        return gauge.problem.removeprefix(f"gauge {gauge.name}: ")
    if gauge.shown_mm is None:
        return "no answer yet"
    if (place := plunger_place(gauge)) is None:
        return "set it to mid travel by eye"
    if abs(place) <= mounting_mm:
        return f"in place, {abs(place):.1f} mm from mid travel"
    # A plunger that is pushed in too far has to be moved away from the ball.
    direction = "out" if place > 0.0 else "in"
    side = "+" if place * gauge.sign > 0.0 else "-"
    return f"move it {abs(place):.1f} mm {direction}, along {side}{gauge.axis}"


def _picture(
    gauges: Sequence[GaugeSnapshot], urgencies: dict[str, Urgency]
) -> tuple[tuple[Line, ...], ...]:
    cells = [[(" ", Urgency.CALM)] * COLUMNS for _ in range(ROWS)]

    def put(row: int, column: int, text: str, urgency: Urgency = Urgency.CALM) -> None:
        for offset, one in enumerate(text):
            cells[row][column + offset] = (one, urgency)

    for row, column, text in AXES:
        put(row, column, text)
    for row, column, text in BALL:
        put(MIDDLE[0] + row, MIDDLE[1] + column, text)
    for gauge in gauges:
        for row, column, text in _gauge_pieces(gauge):
            put(MIDDLE[0] + row, MIDDLE[1] + column, text, urgencies[gauge.axis])
    return tuple(_runs(row) for row in cells)


def _gauge_pieces(gauge: GaugeSnapshot) -> tuple[tuple[int, int, str], ...]:
    """Row, column and text of a gauge on its side of the ball: y is drawn slanting, into the picture."""
    is_positive = gauge.sign > 0
    name = f"{'+' if is_positive else '-'}{gauge.axis}"
    match gauge.axis, is_positive:
        case "x", True:
            return ((0, 4, "◀━━━▐██▌"), (-1, 8, name))
        case "x", False:
            return ((0, -12, "▐██▌━━━▶"), (-1, -11, name))
        case "y", True:
            return ((-2, 3, "↙"), (-3, 4, "/"), (-4, 5, "▟█▛"), (-5, 6, f"▟█▛ {name}"))
        case "y", False:
            return ((2, -4, "↗"), (3, -5, "/"), (4, -7, "▟█▛"), (5, -8, f"▟█▛ {name}"))
        case "z", True:
            return ((-5, -1, "██"), (-4, -1, f"██ {name}"), (-3, -1, "┃"), (-2, -1, "▼"))
        case _:
            return ((2, -1, "▲"), (3, -1, "┃"), (4, -1, f"██ {name}"), (5, -1, "██"))


def _runs(row: Sequence[tuple[str, Urgency]]) -> tuple[Line, ...]:
    """A row of characters as pieces of one urgency each."""
    runs: list[Line] = []
    for one, urgency in row:
        if runs and runs[-1][1] is urgency:
            runs[-1] = (runs[-1][0] + one, urgency)
        else:
            runs.append((one, urgency))
    return tuple(runs)
