"""The screen of the first-time assistant: one question after the other."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import ClassVar, Protocol

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical
from textual.screen import Screen
from textual.widgets import Input

from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.views import FirstQuestionView, Urgency


class Assistant(Protocol):
    """Asks for what a cell file needs."""

    is_done: bool

    def view(self) -> FirstQuestionView:
        """The question that is asked now."""
        ...

    def answer(self, given: str) -> None:
        """Take an answer."""
        ...

    def back(self) -> None:
        """Return to the question before."""
        ...


class AssistantScreen(Screen[bool]):
    """Gives whether the cell file was made."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "back", "The question before"),
        ("ctrl+q", "dismiss(False)", "Quit without a file"),
    ]
    AUTO_FOCUS = "Input"

    def __init__(self, assistant: Assistant, path: Path) -> None:
        super().__init__()
        self._assistant, self._path = assistant, path

    def compose(self) -> ComposeResult:
        """One question, a field, and what is wrong with the answer."""
        yield TextPanel(
            f"hexacell | There is no {self._path.name} yet. Some questions lead to it.", id="where"
        )
        with Vertical(id="assistant"):
            yield TextPanel(id="progress", classes="title")
            yield TextPanel(id="first-question")
            yield TextPanel(id="first-hint", classes="hint")
            yield Input(id="first-answer", compact=True)
            yield TextPanel(id="first-problem")
            yield TextPanel(
                "Enter takes the answer, Escape goes back to the one before, ctrl+q quits without a file.",
                classes="hint",
            )

    def on_mount(self) -> None:
        """Ask the first question."""
        self.query_one(Input).cursor_blink = False
        self._show()

    async def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take the answer; in a thread, as the last one takes a second."""
        await asyncio.to_thread(self._assistant.answer, event.value)
        if self._assistant.is_done:
            self.dismiss(True)
        else:
            self._show()

    def action_back(self) -> None:
        """Return to the question before."""
        self._assistant.back()
        self._show()

    def _show(self) -> None:
        view, field = self._assistant.view(), self.query_one(Input)
        self.query_one("#progress", TextPanel).show(view.progress)
        self.query_one("#first-question", TextPanel).show(view.text)
        self.query_one("#first-hint", TextPanel).show(view.hint)
        self.query_one("#first-problem", TextPanel).show(view.problem, Urgency.ALARM)
        if not view.problem:
            field.value = view.answer
            field.cursor_position = len(view.answer)
