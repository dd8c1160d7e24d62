"""The screen of a result: the verdict first, everything behind it below."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical, VerticalScroll

from hexacell.screen.backend import Backend
from hexacell.screen.tab_screen import TabScreen
from hexacell.screen.widgets.plot_panel import PlotPanel
from hexacell.screen.widgets.text_panel import TextPanel

PLOTS = 3


class ReviewScreen(TabScreen):
    """The verdict stays in sight; the rest scrolls below it."""

    TAB = "review"
    AUTO_FOCUS = "#details"

    def compose_body(self) -> ComposeResult:
        """See the class."""
        yield TextPanel(id="verdict")
        yield TextPanel(id="scope")
        yield TextPanel(id="approval")
        with VerticalScroll(id="details"):
            yield TextPanel("Held-out poses, before and after", classes="title")
            yield TextPanel(id="comparison")
            with Horizontal(id="plots"):
                for number in range(PLOTS):
                    yield PlotPanel(id=f"plot-{number}", classes="plot")
            with Vertical():
                yield TextPanel("Parameters", classes="title")
                yield TextPanel(id="parameters-header", classes="table-header")
                yield TextPanel(id="parameters")
                yield TextPanel("The change of the controller's config", classes="title")
                yield TextPanel(id="change")

    def draw_body(self, backend: Backend) -> None:
        """Show the result."""
        view = backend.review()
        self.query_one("#verdict", TextPanel).show(view.verdict, view.urgency)
        self._show("#scope", view.scope)
        self.query_one("#approval", TextPanel).show(view.approval)
        self._show("#comparison", view.comparison)
        self.query_one("#parameters-header", TextPanel).show(view.parameters_header)
        self._show("#parameters", view.parameters)
        self._show("#change", view.change)
        for number, plot in enumerate(view.plots[:PLOTS]):
            self.query_one(f"#plot-{number}", PlotPanel).show(plot)

    def _show(self, place: str, lines: tuple[str, ...]) -> None:
        self.query_one(place, TextPanel).show("\n".join(lines))
