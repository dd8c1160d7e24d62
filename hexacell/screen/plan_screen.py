"""The poses of the plan: each may be taken out before the run begins, and put back."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen

from hexacell.screen.backend import Backend
from hexacell.screen.widgets.row_list import RowList
from hexacell.screen.widgets.text_panel import TextPanel

WHAT_TO_PRESS = (
    "x takes the chosen pose out, or puts it back; on the line of a point the whole point. "
    "v tries the plan again, Escape goes back."
)


class PlanScreen(Screen[None]):
    """What is taken out and what that costs above, the poses below."""

    AUTO_FOCUS = "#poses"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("x,space,delete", "take_out", "Take out or put back", show=False),
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
        await self.action_take_out()

    async def action_take_out(self) -> None:
        """Take out what is chosen, or put it back."""
        if (name := self.query_one(RowList).chosen) is not None:
            await self.run_action(f"app.perform('take out', {name!r})")
