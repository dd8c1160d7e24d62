"""The poses of the plan, and what the cell file excludes."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen

from hexacell.screen.backend import Backend
from hexacell.screen.widgets.row_list import RowList
from hexacell.screen.widgets.text_panel import TextPanel

WHAT_TO_PRESS = (
    "x excludes the chosen pose in the cell file, or the whole point on its line; on a line with OUT "
    "it removes that exclusion. v tries the plan again, Escape goes back."
)


class PlanScreen(Screen[None]):
    """Exclusions above, the planned poses below."""

    AUTO_FOCUS = "#poses"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("x,space,delete", "exclude", "Exclude, or remove the exclusion", show=False),
        Binding("v", "app.perform('preview')", "Try the plan", show=False),
        Binding("escape", "dismiss", "Back", show=False),
    ]

    def compose(self) -> ComposeResult:
        """See the class."""
        yield TextPanel("The poses of the plan", classes="title")
        yield TextPanel(id="plan-note", classes="instruction")
        yield RowList(id="poses")
        yield TextPanel(WHAT_TO_PRESS, id="plan-hint", classes="hint")

    def draw(self, backend: Backend) -> None:
        """Show the poses."""
        view = backend.plan()
        self.query_one("#plan-note", TextPanel).show(view.note)
        self.query_one(RowList).show(view.rows)

    async def on_option_list_option_selected(self) -> None:
        """Enter does the same."""
        await self.action_exclude()

    async def action_exclude(self) -> None:
        """Exclude what is chosen, or remove that exclusion."""
        if (name := self.query_one(RowList).chosen) is not None:
            await self.run_action(f"app.perform('exclude', {name!r})")
