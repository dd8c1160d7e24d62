"""A question above the screen: its paragraphs scroll, and it takes exactly the answers that it offers."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical, VerticalScroll
from textual.events import Key
from textual.screen import ModalScreen, ScreenResultType
from textual.widgets import Input

from hexacell.screen.widgets.device_panel import DevicePanel
from hexacell.screen.widgets.text_panel import TextPanel
from hexacell.text.screens.views import Choice, QuestionView

LONGEST_TYPED = 200
"""What is pasted by mistake may be a whole file."""


class AnswerOverlay(ModalScreen[ScreenResultType]):
    """Consent is one key, or a text that must be typed in full."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("pagedown", "scroll_text(1)", "Scroll on"),
        ("pageup", "scroll_text(-1)", "Scroll back"),
    ]
    AUTO_FOCUS = "#question-text"

    def __init__(self, view: QuestionView) -> None:
        super().__init__()
        self.view = view

    @abstractmethod
    async def give(self, value: str | None) -> None:
        """Give an answer."""

    def compose(self) -> ComposeResult:
        """The question, the gauges where they matter, and what to press."""
        view = self.view
        with Vertical(id="question", classes=f"overlay overlay-{view.urgency}"):
            yield TextPanel(view.title, classes="overlay-title")
            with VerticalScroll(id="question-text"):
                yield TextPanel("\n\n".join(view.paragraphs))
            if view.shows_gauges:
                yield DevicePanel(id="mounting", for_mounting=True)
            if view.refusal:
                yield TextPanel(view.refusal, id="refusal")
            yield TextPanel(view.instruction, id="instruction")
            for choice in view.choices:
                yield TextPanel(_line(choice, view), classes=_classes(choice, view))
            if view.typed and not view.refusal:
                yield Input(placeholder=view.typed, id="typed", compact=True, max_length=LONGEST_TYPED)

    def on_mount(self) -> None:
        """What is typed goes into the field, if there is one."""
        for field in self.query(Input):
            field.cursor_blink = False
            field.focus()

    def action_scroll_text(self, pages: int) -> None:
        """Scroll what is asked, also while a name is typed."""
        text = self.query_one("#question-text", VerticalScroll)
        text.scroll_relative(y=pages * text.size.height, animate=False)

    async def on_key(self, event: Key) -> None:
        """Take an answer of one key."""
        for choice in self.view.choices:
            if event.key == choice.key and self._may_be_given(choice):
                event.stop()
                await self.give(choice.value)

    async def on_input_submitted(self, event: Input.Submitted) -> None:
        """Take consent that is typed in full."""
        if event.value.strip().lower() == self.view.typed.lower():
            await self.give(self.view.consent)

    def _may_be_given(self, choice: Choice) -> bool:
        is_typing = isinstance(self.focused, Input) and len(choice.key) == 1
        return not is_typing and not (choice.is_consent and bool(self.view.refusal))


def _line(choice: Choice, view: QuestionView) -> str:
    blocked = choice.is_consent and view.refusal
    key = choice.key if len(choice.key) == 1 else choice.key.capitalize()
    return f"  {'--' if blocked else key:8} {choice.label}"


def _classes(choice: Choice, view: QuestionView) -> str:
    return "choice refused" if choice.is_consent and view.refusal else "choice"
