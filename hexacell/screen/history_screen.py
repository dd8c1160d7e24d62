"""The screen of a cell's runs: list, comparison, and rollback."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType

from hexacell.screen.backend import Backend
from hexacell.screen.tab_screen import TabScreen
from hexacell.screen.widgets.row_list import RowList
from hexacell.screen.widgets.text_panel import TextList, TextPanel


class HistoryScreen(TabScreen):
    """The runs above, what was asked about one of them below."""

    TAB = "history"
    AUTO_FOCUS = "#runs"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "about('compare')", "Compare with the one before", show=False),
        Binding("b", "about('roll back')", "Go back to its config, or undo it", show=False),
        Binding("w", "write", "Write its proposal", show=False),
        Binding("o", "app.perform('drift')", "Drift over all runs", show=False),
    ]

    is_asked = False

    def compose_body(self) -> ComposeResult:
        """See the class."""
        yield TextPanel(id="history-header", classes="table-header")
        yield RowList(id="runs")
        yield TextPanel("Comparison", classes="title")
        yield TextList(id="comparison")

    def draw_body(self, backend: Backend) -> None:
        """Show the runs."""
        self.is_asked = backend.question() is not None
        view = backend.history()
        self.query_one("#history-header", TextPanel).show(view.note or view.header)
        self.query_one("#comparison", TextList).show(view.comparison)
        self.query_one(RowList).show([(entry.name, entry.line) for entry in view.entries])

    async def action_about(self, what: str) -> None:
        """Do something about the run that is chosen."""
        if (run := self.query_one(RowList).chosen) is not None:
            await self.run_action(f"app.perform({what!r}, {run!r})")

    async def action_write(self) -> None:
        """Write the proposal of the chosen run; a question that waits comes first, as on every screen."""
        if self.is_asked:
            await self.run_action("app.answer")
        else:
            await self.action_about("apply")

    async def on_option_list_option_selected(self) -> None:
        """Open the run."""
        await self.action_about("open")
