"""Axes of pictures have round values, and what there is to see is drawn with its limit."""

from math import log10

import pytest
from textual.app import App, ComposeResult
from textual_plot import PlotWidget

from hexacell.screen.plot_panel import PlotPanel, decades, whole_numbers
from hexacell.text.screens.views import PlotView, Series
from tests.waiting import until


def test_records_are_counted_in_round_whole_numbers() -> None:
    assert whole_numbers(-1.2, 56.7, most=8) == [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]
    assert whole_numbers(0.96, 2.04, most=8) == [1.0, 2.0]
    assert len(whole_numbers(1.0, 55.0, most=3)) <= 3


def test_logarithms_have_round_values() -> None:
    shown = [10.0**one for one in decades(log10(0.03), log10(3.0))]
    assert shown == pytest.approx([0.05, 0.1, 0.2, 0.5, 1.0, 2.0])
    assert [10.0**one for one in decades(-3.0, 1.0)] == pytest.approx([0.001, 0.01, 0.1, 1.0, 10.0])


class OnePlot(App[None]):
    def compose(self) -> ComposeResult:
        yield PlotPanel(id="plot")


def view(*points: tuple[float, float]) -> PlotView:
    return PlotView(
        "Error, mm", "records", (Series("so far", "o", points),), 0.1, "limit", True, "Nothing yet."
    )


async def test_a_note_stands_until_there_is_something_to_draw_within_both_axes() -> None:
    app = OnePlot()
    async with app.run_test(size=(60, 20)) as pilot:
        panel = app.query_one(PlotPanel)
        panel.show(view())
        assert not panel.query(PlotWidget)
        panel.show(view((1.0, 30.0), (7.0, 0.05)))
        await until(lambda: bool(panel.border_subtitle))
        await pilot.pause()
        plot = app.query_one(PlotWidget)
        assert plot.display
        assert panel.border_subtitle == "o so far   ┄ limit   → records"
        assert plot._x_min < 1.0
        assert plot._x_max > 7.0
        assert plot._y_min < log10(0.05) < log10(30.0) < plot._y_max
