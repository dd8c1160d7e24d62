"""The screen of the cell: its devices live, and what its file says."""

from __future__ import annotations

from textual.app import ComposeResult

from hexacell.screen.backend import Backend
from hexacell.screen.tab_screen import TabScreen
from hexacell.screen.widgets.device_panel import DevicePanel
from hexacell.screen.widgets.text_panel import TextList, TextPanel


class CellScreen(TabScreen):
    """Devices above, the file below."""

    TAB = "cell"
    AUTO_FOCUS = "#settings"

    def compose_body(self) -> ComposeResult:
        """See the class."""
        yield TextPanel("Devices, as they show now", classes="title")
        yield DevicePanel(id="devices")
        yield TextPanel("Cell file", id="settings-title", classes="title")
        yield TextList(id="settings")

    def draw_body(self, backend: Backend) -> None:
        """Show the cell."""
        view = backend.cell()
        self.query_one(DevicePanel).show(view.live)
        self.query_one("#settings-title", TextPanel).show(view.title)
        self.query_one("#settings", TextList).show([*view.problems, *view.warnings, *view.settings])
