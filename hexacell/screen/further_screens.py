"""Screens beside the five: gauges in large figures, the planned poses, and the first-time assistant."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.screen import Screen
from textual.widgets import Digits, Input

from hexacell.screen.widgets import RowList, TextPanel, show_parts
from hexacell.text.screens.views import Urgency

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel
    from hexacell.text.screens.first_questions import FirstCellAssistant

GAUGES = 3

WHAT_TO_PRESS = (
    "x excludes the chosen pose or point in the cell file; on a line with OUT it removes that. "
    "v tries the plan again, Escape goes back."
)


class DigitsScreen(Screen[None]):
    """Deviation of each gauge where there is a zero, else its reading."""

    BINDINGS: ClassVar[list[BindingType]] = [("d,escape,enter", "dismiss", "Back")]
    _records = -1

    def compose(self) -> ComposeResult:
        """What happens now, and three figures."""
        yield TextPanel(id="digits-now")
        for number in range(GAUGES):
            yield Digits(id=f"digits-{number}", classes="digits")
        yield TextPanel("mm, deviation from the reference where there is one. d or Escape goes back.")

    def draw(self, model: ScreenModel) -> None:
        """Show the gauges."""
        now, figures, records = model.figures()
        self.query_one("#digits-now", TextPanel).show(now)
        for number, (figure, urgency) in enumerate(figures[:GAUGES]):
            digits = self.query_one(f"#digits-{number}", Digits)
            digits.update(figure)
            digits.set_class(urgency is Urgency.ALARM, "urgency-alarm")
        if self._records not in {-1, records}:
            self.app.bell()
        self._records = records


class PlanScreen(Screen[None]):
    """Exclusions above, the planned poses below."""

    AUTO_FOCUS = "#poses"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("x,space,delete", "exclude", "Exclude, or remove the exclusion", show=False),
        Binding("v", "app.perform('preview')", "Try the plan", show=False),
        Binding("escape", "dismiss", "Back", show=False),
    ]

    def compose(self) -> ComposeResult:
        """The parts of this screen."""
        yield TextPanel("The poses of the plan", classes="title")
        yield TextPanel(id="plan-note", classes="instruction")
        yield RowList(id="poses")
        yield TextPanel(WHAT_TO_PRESS, id="plan-hint", classes="hint")

    def draw(self, model: ScreenModel) -> None:
        """Show the poses."""
        show_parts(self, model, "plan")

    async def on_option_list_option_selected(self) -> None:
        """Enter does the same."""
        await self.action_exclude()

    async def action_exclude(self) -> None:
        """Exclude what is chosen, or remove that exclusion."""
        if (name := self.query_one(RowList).chosen) is not None:
            await self.run_action(f"app.perform('exclude', {name!r})")


class AssistantScreen(Screen[bool]):
    """Gives whether the cell file was made."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "back", "The question before"),
        ("ctrl+q", "dismiss(False)", "Quit without a file"),
    ]
    AUTO_FOCUS = "Input"

    def __init__(self, assistant: FirstCellAssistant, path: Path) -> None:
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
        assistant, field = self._assistant, self.query_one(Input)
        text, hint = assistant.question
        self.query_one("#progress", TextPanel).show(assistant.progress)
        self.query_one("#first-question", TextPanel).show(text)
        self.query_one("#first-hint", TextPanel).show(hint)
        self.query_one("#first-problem", TextPanel).show(assistant.problem, Urgency.ALARM)
        if not assistant.problem:
            field.value = assistant.suggestion
            field.cursor_position = len(field.value)
