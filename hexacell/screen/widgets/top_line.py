"""The first two lines of every screen: where one is, in what state, and the other screens."""

from __future__ import annotations

from collections.abc import Mapping

from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.content import Content
from textual.widgets import Static

from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.views import HeaderView

TABS = {
    "cell": "Cell",
    "preflight": "Preflight",
    "measure": "Measure",
    "review": "Review",
    "history": "History",
}


class TopLine(Horizontal):
    """The cell, what is done there, its state, and who is in control."""

    def compose(self) -> ComposeResult:
        """Left what is done, right how it stands."""
        yield TextPanel("hexacell", id="where")
        yield TextPanel("starting", id="state")

    def show(self, view: HeaderView) -> None:
        """Show a header."""
        where = " | ".join(part for part in ("hexacell", view.cell, view.activity) if part)
        state = " | ".join(part for part in (view.status, view.control) if part)
        self.query_one("#where", TextPanel).show(where)
        self.query_one("#state", TextPanel).show(state, view.urgency)


class TabLine(Static):
    """The five screens with their keys; the present one is marked."""

    def __init__(self, present: str, keys: Mapping[str, str]) -> None:
        parts = [
            Content.from_markup(
                f"[@click=app.show('{name}')]{'[reverse b]>' if name == present else ' '}$text "
                f"{'[/]' if name == present else ''}[/]",
                text=f"{keys[name]} {title}",
            )
            for name, title in TABS.items()
        ]
        super().__init__(Content("  ").join(parts))
