"""Something went wrong: what, why, and what to do next."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen

from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.views import FaultView


class FaultOverlay(ModalScreen[None]):
    """Stays until it was read."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("enter,escape,space", "dismiss", "Read"),
        ("a", "app.perform('abort')", "Abort"),
    ]

    def __init__(self, view: FaultView) -> None:
        super().__init__()
        self._view = view

    def compose(self) -> ComposeResult:
        """Title, cause, next action."""
        with Vertical(id="fault", classes="overlay overlay-alarm"):
            yield TextPanel(self._view.title, classes="overlay-title")
            with VerticalScroll(id="fault-cause"):
                yield TextPanel(self._view.cause)
            if self._view.action:
                yield TextPanel(f"What to do: {self._view.action}", id="fault-action")
            yield TextPanel("Enter closes this.", classes="hint")
