"""Screens beside the five: large figures, the cell file, the planned poses, the first-time assistant."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.screen import Screen
from textual.widgets import Digits, Input

from hexacell.screen.widgets import BannerBar, RowList, TextList, TextPanel, set_urgency, show_parts, titled
from hexacell.text.screens.views import Urgency

if TYPE_CHECKING:
    from hexacell.screen.model import ScreenModel
    from hexacell.text.screens.first_questions import FirstCellAssistant

GAUGES = 3

WHAT_TO_PRESS = (
    "x excludes the chosen pose or point in the cell file; on a line with OUT it removes the exclusion. "
    "v tries the plan again on simulated robots, some seconds. Escape goes back."
)


class DigitsScreen(Screen[None]):
    """Deviation of each gauge where there is a zero, else its reading, to be read across the room."""

    BINDINGS: ClassVar[list[BindingType]] = [("d,escape,enter", "dismiss", "Back")]
    _records = -1

    def compose(self) -> ComposeResult:
        """The banner, and a figure and a bar for each gauge."""
        yield BannerBar()
        for number in range(GAUGES):
            with titled(Vertical(id=f"gauge-{number}"), ""):
                yield Digits(classes="digits")
                yield TextPanel(classes="digits-bar")
        yield TextPanel("mm, deviation from the reference where there is one. d or Escape goes back.")

    def draw(self, model: ScreenModel) -> None:
        """Show the gauges."""
        self.query_one(BannerBar).show(model.banner("measure"))
        figures, records = model.devices.figures()
        for number, (axis, figure, bar, urgency) in enumerate(figures[:GAUGES]):
            row = self.query_one(f"#gauge-{number}")
            row.border_title = f"gauge {axis}"
            set_urgency(row, urgency)
            row.query_one(Digits).update(figure)
            row.query_one(TextPanel).show(bar)
        if self._records not in {-1, records}:
            self.app.bell()
        self._records = records


class CellFileScreen(Screen[None]):
    """The whole cell file, with the line of each value or that it is a default."""

    AUTO_FOCUS = "#file"
    BINDINGS: ClassVar[list[BindingType]] = [("f,escape,enter", "dismiss", "Back")]

    def __init__(self, title: str, lines: Sequence[str]) -> None:
        super().__init__()
        self._title, self._lines = title, lines

    def compose(self) -> ComposeResult:
        """The text."""
        yield titled(TextList(id="file"), self._title)
        yield TextPanel("The arrows scroll, f or Escape goes back.", classes="hint")

    def on_mount(self) -> None:
        """Show the text."""
        self.query_one(TextList).show(self._lines)


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
        yield TextPanel(id="plan-note", classes="instruction")
        yield titled(RowList(id="poses"), "The poses of the plan")
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
            f"hexacell │ There is no {self._path.name} yet. Some questions lead to it.", id="where"
        )
        with titled(Vertical(id="assistant"), ""):
            yield TextPanel(id="first-question")
            yield TextPanel(id="first-hint", classes="hint")
            yield Input(id="first-answer", compact=True)
            yield TextPanel(id="first-problem")
            yield TextPanel(
                "Enter takes the answer, Escape goes back by one question, ctrl+q quits without a file.",
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
        self.query_one("#assistant").border_title = assistant.progress
        self.query_one("#first-question", TextPanel).show(text)
        self.query_one("#first-hint", TextPanel).show(hint)
        self.query_one("#first-problem", TextPanel).show(assistant.problem, Urgency.ALARM)
        if not assistant.problem:
            field.password = assistant.is_secret
            field.value = assistant.suggestion
            field.cursor_position = len(field.value)
