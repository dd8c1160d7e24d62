"""The screen of a run that is being measured."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical

from hexacell.screen.backend import Backend
from hexacell.screen.tab_screen import TabScreen
from hexacell.screen.widgets.device_panel import DevicePanel
from hexacell.screen.widgets.guidance_panel import GuidancePanel
from hexacell.screen.widgets.plot_panel import PlotPanel
from hexacell.screen.widgets.text_panel import TextList, TextPanel


class MeasureScreen(TabScreen):
    """Guidance above, the devices, and below the records beside the predicted accuracy."""

    TAB = "measure"
    AUTO_FOCUS = "#records"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("space", "app.perform('play')", "Play or halt", show=False, priority=True),
        Binding("plus", "app.perform('play', '+')", "Faster", show=False),
        Binding("minus", "app.perform('play', '-')", "Slower", show=False),
        Binding("right", "app.perform('step', '1')", "One event on", show=False, priority=True),
        Binding("left", "app.perform('step', '-1')", "One event back", show=False, priority=True),
        Binding("pagedown", "app.perform('step', '100')", "A hundred on", show=False, priority=True),
        Binding("pageup", "app.perform('step', '-100')", "A hundred back", show=False, priority=True),
        Binding("home", "app.perform('step', 'first')", "To the beginning", show=False, priority=True),
        Binding("end", "app.perform('step', 'last')", "To the end", show=False, priority=True),
    ]

    def compose_body(self) -> ComposeResult:
        """See the class."""
        yield GuidancePanel()
        yield TextPanel("Devices", id="devices-title", classes="title")
        yield DevicePanel(id="devices")
        with Horizontal(id="lower"):
            with Vertical(id="record-side"):
                yield TextPanel(id="records-title", classes="title")
                yield TextPanel(id="records-header", classes="table-header")
                yield TextList(id="records", follows=True)
            yield PlotPanel(id="accuracy")

    def draw_body(self, backend: Backend) -> None:
        """Show the run."""
        view = backend.measure()
        self.query_one(GuidancePanel).show(view.guidance)
        self.query_one(DevicePanel).show(view.live)
        self.query_one("#records-title", TextPanel).show(view.records_title)
        self.query_one("#records-header", TextPanel).show(view.records_header)
        self.query_one("#records", TextList).show(view.records)
        self.query_one(PlotPanel).show(view.accuracy)
