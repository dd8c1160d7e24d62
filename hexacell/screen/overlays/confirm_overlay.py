"""One question of the screen itself, answered by yes or no."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical
from textual.screen import ModalScreen

from hexacell.screen.widgets.text_panel import TextPanel


class ConfirmOverlay(ModalScreen[bool]):
    """Gives whether the answer was yes."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("y", "dismiss(True)", "Yes"),
        ("n,escape", "dismiss(False)", "No"),
    ]

    def __init__(self, question: str) -> None:
        super().__init__()
        self._question = question

    def compose(self) -> ComposeResult:
        """The question."""
        with Vertical(id="confirming", classes="overlay"):
            yield TextPanel(self._question)
            yield TextPanel("Press y or n.", classes="hint")
