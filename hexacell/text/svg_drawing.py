"""Drawings as SVG text that is the same, byte for byte, whenever it is drawn."""

import io
import re
from collections.abc import Sequence
from typing import Any

from hexacell.drawing.shapes import COLOURS, Role

SMALLEST_MM = 1e-4
"""A distance that is drawn on a logarithmic axis is no smaller."""

BEFORE, AFTER, INK = COLOURS[Role.BEFORE], COLOURS[Role.AFTER], "#222222"
"""The markers differ besides."""

Place = tuple[float, float, float, float]
"""Left, bottom, width and height of axes, in shares of the figure's."""

STYLE: dict[Any, Any] = {
    "svg.hashsalt": "hexacell",
    "svg.fonttype": "path",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
}


def new_figure(size: tuple[float, float], *places: Place) -> tuple[Any, list[Any]]:
    """A figure of a width and a height, inches, without pyplot, which keeps state; and its axes."""
    from matplotlib import rc_context  # noqa: PLC0415 - half a second that only figures need
    from matplotlib.figure import Figure  # noqa: PLC0415 - likewise

    with rc_context(STYLE):
        figure = Figure(figsize=size)
        return figure, [figure.add_axes(place) for place in places]


def columns(pairs: Sequence[tuple[float, float]]) -> tuple[Sequence[float], Sequence[float]]:
    """The first and the second numbers of some pairs."""
    return [x for x, _ in pairs], [y for _, y in pairs]


def plain_ticks(axis: Any) -> None:  # noqa: ANN401 - matplotlib is imported where it is used
    """Numbers as they are read at 1, 2 and 5 of each decade of a logarithmic axis."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter  # noqa: PLC0415 - likewise

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def as_svg(figure: Any) -> str:  # noqa: ANN401 - matplotlib is imported where it is used
    """Its text, from the element ``svg`` on."""
    from matplotlib import rc_context  # noqa: PLC0415 - half a second that only figures need

    stream = io.StringIO()
    with rc_context(STYLE):
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return re.sub(r"\A.*?(?=<svg )", "", stream.getvalue(), flags=re.DOTALL)
