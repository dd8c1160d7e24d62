"""Quitting while a run goes on: stop it, or leave it to itself."""

from __future__ import annotations

from typing import ClassVar, Literal

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical
from textual.screen import ModalScreen

from hexacell.screen.widgets.text_panel import TextPanel

Leaving = Literal["stop", "leave", "stay"]


class QuitOverlay(ModalScreen[Leaving]):
    """Asks what becomes of the run."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("s", "dismiss('stop')", "Stop it and quit"),
        ("l", "dismiss('leave')", "Leave it running"),
        ("escape,enter", "dismiss('stay')", "Stay"),
    ]

    def compose(self) -> ComposeResult:
        """The question."""
        with Vertical(id="quitting", classes="overlay"):
            yield TextPanel("A run goes on here", classes="overlay-title")
            yield TextPanel("What is to become of it?")
            yield TextPanel("  s        stop it after its step, and quit; it can be resumed")
            yield TextPanel("  l        quit and leave it running; `hexacell tui` comes back to it")
            yield TextPanel("  Escape   stay here")
